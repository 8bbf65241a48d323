#include "server/jobs/auth/url_secret.h"

#include <array>
#include <utility>

#include "proto/text/hex.h"
#include "server/base/check.h"
#include "server/base/log.h"
#include "server/base/random.h"
#include "server/base/sha256.h"
#include "server/jobs/auth/api_key.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

constexpr size_t kUrlSecretDigits = 64;
constexpr size_t kSecretsMax = 2;

fs::path secret_path(const fs::path& data_dir) {
  return data_dir / "url_secret";
}

Result<std::vector<std::string>> read_secrets(const fs::path& file) {
  VOXELD_ASSIGN(const auto text, read_private(file));
  if (!text) return std::vector<std::string>();
  return parse_url_secrets(*text, file.string());
}

}  // namespace

Result<std::vector<std::string>> parse_url_secrets(std::string_view text, const std::string& file) {
  std::vector<std::string> secrets;
  while (!text.empty()) {
    const size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    if (end != kUrlSecretDigits || !is_hex(line) || secrets.size() == kSecretsMax) {
      return Error{ErrorCode::kInternal, file, "one or two lines of 64 hex digits", ""};
    }
    secrets.emplace_back(line);
    text.remove_prefix(end + 1);
  }
  if (!secrets.empty()) return secrets;
  return Error{ErrorCode::kInternal, file, "one or two lines of 64 hex digits", "none"};
}

Result<std::unique_ptr<UrlSecrets>> UrlSecrets::open(const fs::path& data_dir) {
  const fs::path file = secret_path(data_dir);
  {
    VOXELD_ASSIGN(const UniqueFd lock, lock_private(file));
    VOXELD_ASSIGN(const auto secrets, read_secrets(file));
    if (secrets.empty()) VOXELD_TRY(replace_private(file, random_hex(kUrlSecretDigits) + "\n"));
  }
  std::unique_ptr<UrlSecrets> opened(new UrlSecrets(file));
  if (!opened->current()->empty()) return opened;
  return Error{ErrorCode::kInternal, file.string() + " cannot be read", "", ""};
}

std::shared_ptr<const UrlSecrets::Secrets> UrlSecrets::current() const {
  const MutexLock lock(mutex_);
  // Before the file is read: what changes after this is seen by the next call.
  const FileMark mark = mark_of(file_);
  if (secrets_ != nullptr && mark == seen_) return secrets_;
  secrets_ = nullptr;  // whatever becomes of the rest, the next call reads the file again
  auto secrets = read_secrets(file_);
  if (!secrets) {
    log::error("links can be neither signed nor verified", {{"error", secrets.error().message()}});
    return std::make_shared<const Secrets>();
  }
  secrets_ = std::make_shared<const Secrets>(*std::move(secrets));
  seen_ = mark;
  return secrets_;
}

Result<std::string> UrlSecrets::sign(std::string_view text) const {
  const auto secrets = current();
  if (!secrets->empty()) return hmac_sha256(secrets->front(), text);
  return Error{ErrorCode::kInternal, "there is no secret to sign links with", "", ""};
}

bool UrlSecrets::verify(std::string_view text, std::string_view signature) const {
  bool is_good = false;
  const auto secrets = current();
  for (const std::string& secret : *secrets) {
    if (equal_in_constant_time(hmac_sha256(secret, text), signature)) is_good = true;
  }
  return is_good;
}

Status rotate_url_secret(const fs::path& data_dir) {
  const fs::path file = secret_path(data_dir);
  VOXELD_ASSIGN(const UniqueFd lock, lock_private(file));
  VOXELD_ASSIGN(const auto secrets, read_secrets(file));
  std::string text = random_hex(kUrlSecretDigits) + "\n";
  if (!secrets.empty()) text += secrets.front() + "\n";
  return replace_private(file, text);
}

}  // namespace voxeld
