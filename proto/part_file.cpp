#include "proto/part_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string>

namespace voxeld {
namespace {

constexpr int kPartNamesMax = 100;
constexpr size_t kPartStemBytesMax = 200;  // a file system takes names of 255

}  // namespace

int create_part(const std::filesystem::path& target, std::filesystem::path& part) {
  struct stat old {};
  const bool replaces = ::stat(target.c_str(), &old) == 0;
  // Another thread may write one, and a process of this number may have left one: the first of a
  // container always has the same.
  const std::filesystem::path folder = target.parent_path();
  const std::string first =
      target.filename().string().substr(0, kPartStemBytesMax) + ".part-" + std::to_string(getpid());
  int descriptor = -1;
  for (int i = 0; descriptor < 0 && i < kPartNamesMax && (i == 0 || errno == EEXIST); ++i) {
    part = folder / (i == 0 ? first : first + "-" + std::to_string(i));
    descriptor =
        ::open(part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, replaces ? 0600 : 0666);
  }
  if (descriptor >= 0 && replaces) {
    // Rights of another owner's group or of setuid would be given to the wrong ones.
    const bool is_same_owner = ::fchown(descriptor, old.st_uid, old.st_gid) == 0;
    (void)::fchmod(descriptor, old.st_mode & (is_same_owner ? 07777U : 0700U));
  }
  return descriptor;
}

}  // namespace voxeld
