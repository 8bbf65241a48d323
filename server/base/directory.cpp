#include "server/base/directory.h"

#include <dirent.h>
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <memory>
#include <string_view>

#include "server/base/file.h"

namespace voxeld {
namespace {

// Limits the recursion. A worker's files are one level deep, so a deeper tree is an attack.
constexpr int kDepthMax = 32;

struct Closer {
  void operator()(DIR* directory) const { ::closedir(directory); }
};
using OpenDirectory = std::unique_ptr<DIR, Closer>;

bool is_entry(std::string_view name) {
  return name != "." && name != "..";
}

// Takes ownership of the descriptor.
void remove_content(int fd, int depth) noexcept {
  const OpenDirectory directory(::fdopendir(fd));
  if (directory == nullptr) {
    ::close(fd);
    return;
  }
  while (const dirent* entry = ::readdir(directory.get())) {
    const char* name = entry->d_name;
    if (!is_entry(name) || ::unlinkat(fd, name, 0) == 0 || depth == kDepthMax) continue;
    const int inner = ::openat(fd, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (inner < 0) continue;
    remove_content(inner, depth + 1);
    ::unlinkat(fd, name, AT_REMOVEDIR);
  }
}

}  // namespace

Result<std::vector<std::string>> directory_names(const std::filesystem::path& path) {
  const OpenDirectory directory(::opendir(path.c_str()));
  std::vector<std::string> names;
  if (directory == nullptr && errno == ENOENT) return names;
  if (directory == nullptr) return errno_error("list", path);
  errno = 0;
  while (const dirent* entry = ::readdir(directory.get())) {
    if (is_entry(entry->d_name)) names.emplace_back(entry->d_name);
    errno = 0;
  }
  if (errno != 0) return errno_error("list", path);
  return names;
}

void remove_tree(const std::filesystem::path& path) noexcept {
  const int fd = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (fd < 0) return;
  remove_content(fd, 0);
  ::rmdir(path.c_str());
}

}  // namespace voxeld
