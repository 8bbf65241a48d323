#include "server/store/held_files.h"

#include <sys/stat.h>

#include "server/base/disk/directory.h"

namespace voxeld {

bool is_deleted(int fd) {
  struct stat info {};
  return ::fstat(fd, &info) == 0 && info.st_nlink == 0;
}

HeldFiles::Hold HeldFiles::add(std::string tenant, int fd) {
  {
    const MutexLock lock(mutex_);
    open_[tenant].insert(fd);
  }
  return {*this, std::move(tenant), fd};
}

void HeldFiles::remove(const std::string& tenant, int fd) {
  const MutexLock lock(mutex_);
  const auto of_tenant = open_.find(tenant);
  of_tenant->second.erase(fd);
  if (of_tenant->second.empty()) open_.erase(of_tenant);
}

int64_t HeldFiles::bytes(std::string_view tenant) const {
  const MutexLock lock(mutex_);
  const auto of_tenant = open_.find(tenant);
  if (of_tenant == open_.end()) return 0;
  std::set<std::pair<dev_t, ino_t>> counted;
  int64_t bytes = 0;
  for (const int fd : of_tenant->second) {
    struct stat info {};
    if (::fstat(fd, &info) != 0 || info.st_nlink != 0) continue;
    if (!counted.emplace(info.st_dev, info.st_ino).second) continue;
    bytes += disk_bytes(info);
  }
  return bytes;
}

}  // namespace voxeld
