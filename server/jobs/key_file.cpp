#include "server/jobs/key_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <set>
#include <span>
#include <system_error>
#include <thread>
#include <utility>

#include "server/base/file.h"
#include "server/base/file_lock.h"
#include "server/base/sha256.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kHead =
    "# voxeld keys 1: id tenant hash created_ms expires_ms revoked_ms weight role";
constexpr size_t kFields = 8;
constexpr int64_t kFileBytesMax = int64_t{16} << 20;  // some 100,000 keys

// What a line says wrongly.
Error wrong(std::string detail, std::string expected, std::string_view got) {
  return {ErrorCode::kInternal, std::move(detail), std::move(expected),
          "\"" + std::string(got.substr(0, 80)) + "\""};
}

// A number in decimal digits.
Result<int64_t> parse_field(std::string_view name, std::string_view text, int64_t min,
                            int64_t max) {
  int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && end == text.data() + text.size() && value >= min && value <= max) {
    return value;
  }
  return wrong(std::string(name), std::to_string(min) + " to " + std::to_string(max), text);
}

Result<std::array<std::string_view, kFields>> split_line(std::string_view line) {
  std::array<std::string_view, kFields> fields;
  std::string_view rest = line;
  for (size_t i = 0; i < kFields; ++i) {
    const size_t end = i + 1 < kFields ? rest.find(' ') : rest.size();
    if (end == std::string_view::npos || end == 0) {
      return wrong("fields", std::to_string(kFields) + " between single spaces", line);
    }
    fields[i] = rest.substr(0, end);
    rest.remove_prefix(std::min(rest.size(), end + 1));
  }
  return fields;
}

Result<ApiKey> parse_line(std::string_view line) {
  constexpr int64_t kTimeMax = int64_t{1} << 53;
  VOXELD_ASSIGN(const auto fields, split_line(line));
  const auto& [id, tenant, hash, created, expires, revoked, weight, role] = fields;
  if (!is_key_id(id)) return wrong("id", "8 of a-z and 2-7", id);
  if (!check_tenant_name(tenant)) return wrong("tenant", "a tenant's name", tenant);
  if (!is_sha256_id(hash)) return wrong("hash", "sha256- and 64 hex digits", hash);
  if (role != "tenant" && role != "admin") return wrong("role", "tenant or admin", role);
  ApiKey key;
  key.id = id;
  key.tenant = tenant;
  key.secret_hash = hash;
  VOXELD_ASSIGN(key.created_ms, parse_field("created_ms", created, 0, kTimeMax));
  VOXELD_ASSIGN(key.expires_ms, parse_field("expires_ms", expires, 0, kTimeMax));
  VOXELD_ASSIGN(key.revoked_ms, parse_field("revoked_ms", revoked, 0, kTimeMax));
  VOXELD_ASSIGN(key.weight, parse_field("weight", weight, 1, kKeyWeightMax));
  key.is_admin = role == "admin";
  return key;
}

Status check_file(int fd, const fs::path& file) {
  struct stat info {};
  if (::fstat(fd, &info) != 0) return errno_error("stat", file);
  if (!S_ISREG(info.st_mode)) {
    return Error{ErrorCode::kInternal, file.string() + " is not a regular file", "", ""};
  }
  if ((info.st_mode & (S_IWGRP | S_IWOTH)) != 0) {
    return Error{ErrorCode::kInternal, file.string() + " can be written by others than its owner",
                 "mode 0600", ""};
  }
  if (info.st_size > kFileBytesMax) {
    return Error{ErrorCode::kInternal, file.string(),
                 "at most " + std::to_string(kFileBytesMax) + " bytes",
                 std::to_string(info.st_size)};
  }
  return {};
}

Result<std::string> read_text(int fd, const fs::path& file) {
  std::string text;
  std::array<char, 65536> buffer;  // NOLINT(cppcoreguidelines-pro-type-member-init)
  while (true) {
    const ssize_t count = ::read(fd, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno_error("read", file);
    if (count == 0) return text;
    text.append(buffer.data(), static_cast<size_t>(count));
  }
}

// An administrator may make keys for a daemon that runs as somebody else, who must be able to read
// them: the directory tells who that is.
Status give_to_owner(int fd, const fs::path& file) {
  struct stat directory {};
  if (::stat(file.parent_path().c_str(), &directory) != 0) return errno_error("stat", file);
  if (::geteuid() != 0 || directory.st_uid == 0) return {};
  if (::fchown(fd, directory.st_uid, directory.st_gid) == 0) return {};
  return errno_error("change the owner of", file);
}

Status write_keys(const fs::path& file, const std::string& text) {
  fs::path temporary = file;
  temporary += ".new";
  ::unlink(temporary.c_str());  // of a process that was killed; O_EXCL: its mode is the one below
  const UniqueFd fd(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (!fd.valid()) return errno_error("create", temporary);
  VOXELD_TRY(write_all(fd.get(), {reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
  VOXELD_TRY(give_to_owner(fd.get(), temporary));
  if (::fsync(fd.get()) != 0) return errno_error("sync", temporary);
  if (::rename(temporary.c_str(), file.c_str()) != 0) return errno_error("replace", file);
  return sync_path(file.parent_path());
}

// Waits for a moment while another process changes the keys.
Result<UniqueFd> lock_keys(const fs::path& data_dir) {
  constexpr int kTries = 100;
  for (int tries = 1;; ++tries) {
    auto lock = lock_file(data_dir / "keys.lock");
    if (lock) VOXELD_TRY(give_to_owner(lock->get(), data_dir / "keys.lock"));
    if (lock || lock.error().code != ErrorCode::kConflict) return lock;
    if (tries == kTries) {
      return Error{ErrorCode::kConflict, "another process changes the keys; try again", "", ""};
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

Status make_data_dir(const fs::path& dir) {
  std::error_code failed;
  const bool made = fs::create_directories(dir, failed);
  if (!failed && made) fs::permissions(dir, fs::perms::owner_all, failed);
  if (!failed) return {};
  return Error{ErrorCode::kInternal,
               "cannot create the data directory " + dir.string() + ": " + failed.message(), "",
               ""};
}

}  // namespace

fs::path key_file_path(const fs::path& data_dir) {
  return data_dir / "keys";
}

Result<KeyList> parse_keys(std::string_view text, const std::string& file) {
  KeyList keys;
  std::set<std::string> ids;
  int line_number = 0;
  const auto at_line = [&](Error error) {
    error.detail = file + " line " + std::to_string(line_number) + ": " + error.detail;
    return error;
  };
  while (!text.empty() || line_number == 0) {
    ++line_number;
    const size_t end = text.find('\n');
    if (end == std::string_view::npos) return at_line(wrong("it ends here", "a line feed", text));
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end + 1);
    if (line_number == 1) {
      if (line != kHead) return at_line(wrong("head", std::string(kHead), line));
      continue;
    }
    auto key = parse_line(line);
    if (!key) return at_line(std::move(key).error());
    if (!ids.insert(key->id).second) {
      return at_line(wrong("id", "one that no line before has", key->id));
    }
    keys.push_back(*std::move(key));
  }
  return keys;
}

std::string keys_text(const KeyList& keys) {
  std::string text(kHead);
  text += '\n';
  for (const ApiKey& key : keys) {
    text += key.id + " " + key.tenant + " " + key.secret_hash;
    for (const int64_t number : {key.created_ms, key.expires_ms, key.revoked_ms, key.weight}) {
      text += " " + std::to_string(number);
    }
    text += key.is_admin ? " admin\n" : " tenant\n";
  }
  return text;
}

Result<std::optional<KeyList>> read_keys(const fs::path& file) {
  const UniqueFd fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!fd.valid() && errno == ENOENT) return std::optional<KeyList>();
  if (!fd.valid()) return errno_error("open", file);
  VOXELD_TRY(check_file(fd.get(), file));
  VOXELD_ASSIGN(const std::string text, read_text(fd.get(), file));
  VOXELD_ASSIGN(KeyList keys, parse_keys(text, file.string()));
  return std::optional(std::move(keys));
}

Status change_keys(const fs::path& data_dir, const std::function<Status(KeyList&)>& change) {
  VOXELD_TRY(make_data_dir(data_dir));
  const fs::path file = key_file_path(data_dir);
  VOXELD_ASSIGN(const UniqueFd lock, lock_keys(data_dir));
  VOXELD_ASSIGN(std::optional<KeyList> keys, read_keys(file));
  if (!keys) keys.emplace();
  VOXELD_TRY(change(*keys));
  return write_keys(file, keys_text(*keys));
}

}  // namespace voxeld
