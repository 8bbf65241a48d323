#include "server/address_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <utility>

namespace voxeld {

Result<AddressFile> AddressFile::write(const std::filesystem::path& path, const std::string& url) {
  std::filesystem::path temporary = path;
  temporary += ".new";
  ::unlink(temporary.c_str());  // of a process that was killed; O_EXCL: its mode is the one below
  UniqueFd fd(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (!fd.valid()) return errno_error("create", temporary);
  if (::flock(fd.get(), LOCK_EX | LOCK_NB) != 0) return errno_error("lock", temporary);
  const std::string text = nlohmann::json{{"url", url}, {"pid", ::getpid()}}.dump() + "\n";
  VOXELD_TRY(write_all(fd.get(), {reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
  if (::rename(temporary.c_str(), path.c_str()) != 0) return errno_error("replace", path);
  return AddressFile(path, std::move(fd));
}

void AddressFile::remove() {
  if (!fd_.valid()) return;
  struct stat own {
  }, there{};
  if (::fstat(fd_.get(), &own) == 0 && ::stat(path_.c_str(), &there) == 0 &&
      own.st_dev == there.st_dev && own.st_ino == there.st_ino) {
    ::unlink(path_.c_str());
  }
  fd_.reset();
}

}  // namespace voxeld
