// DIR/url_secret: what links are signed with. One or two lines of 64 hex digits: the first signs,
// both verify, so that links outlive one rotation. Made by the daemon where it is missing.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/thread_annotations.h"
#include "server/jobs/auth/private_file.h"

namespace voxeld {

// Thread-safe. Looks at the file's stat(2) with every call and reads it where it has changed.
class UrlSecrets {
 public:
  // Errors: internal for a file that is not what it should be, storage-full.
  static Result<std::unique_ptr<UrlSecrets>> open(const std::filesystem::path& data_dir);

  // HMAC-SHA256 of `text` in hex digits. Errors: internal, while the file cannot be read.
  Result<std::string> sign(std::string_view text) const;
  // Whether one of the secrets gives this signature; takes as long wherever they differ.
  bool verify(std::string_view text, std::string_view signature) const;

 private:
  using Secrets = std::vector<std::string>;
  explicit UrlSecrets(std::filesystem::path file) : file_(std::move(file)) {}
  std::shared_ptr<const Secrets> current() const EXCLUDES(mutex_);

  const std::filesystem::path file_;
  mutable Mutex mutex_;
  mutable FileMark seen_ GUARDED_BY(mutex_);
  mutable std::shared_ptr<const Secrets> secrets_ GUARDED_BY(mutex_);
};

// A new first line; the one that signed until now still verifies, the one before does not.
Status rotate_url_secret(const std::filesystem::path& data_dir);

// Errors: internal. `file` goes into errors.
Result<std::vector<std::string>> parse_url_secrets(std::string_view text, const std::string& file);

}  // namespace voxeld
