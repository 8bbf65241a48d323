#include "server/base/file_owner.h"

#include <unistd.h>

#include <array>
#include <cstdio>
#include <string>

namespace voxeld {
namespace {

std::string mode_text(mode_t mode) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "mode %04o", static_cast<unsigned>(mode & 07777));
  return text.data();
}

Status check_owner(const struct stat& info, const std::filesystem::path& path, uid_t owner) {
  const uid_t self = ::geteuid();
  if (info.st_uid == self || info.st_uid == 0 || info.st_uid == owner) return {};
  const std::string uid = std::to_string(self);
  return Error{ErrorCode::kConflict,
               path.string() + " belongs to another user; look who made it, then run chown " + uid +
                   " " + path.string(),
               self == 0 ? "uid 0" : "uid " + uid + " or 0", "uid " + std::to_string(info.st_uid)};
}

Status check_mode(const struct stat& info, const std::filesystem::path& path, mode_t refused,
                  const char* expected, const char* change) {
  if ((info.st_mode & refused) == 0) return {};
  return Error{ErrorCode::kConflict,
               path.string() +
                   " is open to other users; look what they made of it, then run chmod " + change +
                   " " + path.string(),
               expected, mode_text(info.st_mode)};
}

}  // namespace

Status check_trusted(const struct stat& info, const std::filesystem::path& path) {
  VOXELD_TRY(check_owner(info, path, ::geteuid()));
  return check_mode(info, path, S_IWGRP | S_IWOTH, "no write permission for group and others",
                    "go-w");
}

Status check_secret(const struct stat& info, const std::filesystem::path& path, uid_t owner) {
  VOXELD_TRY(check_owner(info, path, owner));
  return check_mode(info, path, S_IRWXG | S_IRWXO, "no permission for group and others", "go-rwx");
}

}  // namespace voxeld
