#include "server/base/host_memory.h"

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <charconv>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace voxeld {
namespace {

constexpr int64_t kKibi = 1024;

// "VmHWM:	  504484 kB"
int64_t status_bytes(std::string_view name) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (!line.starts_with(name)) continue;
    const size_t digit = line.find_first_of("0123456789");
    int64_t value = 0;
    if (digit == std::string::npos) return 0;
    std::from_chars(line.data() + digit, line.data() + line.size(), value);
    return value * kKibi;
  }
  return 0;
}

// A file of one number; 0 for "max" and where there is none.
int64_t number_in(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::string text;
  int64_t value = 0;
  if (stream >> text) std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

// Of version 2, from this process's control group up to the root; 0: none.
int64_t group_limit_bytes() {
  int64_t least = 0;
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    if (!line.starts_with("0::/")) continue;
    std::filesystem::path group = std::filesystem::path("/sys/fs/cgroup") / line.substr(4);
    for (; group.native().starts_with("/sys/fs/cgroup"); group = group.parent_path()) {
      const int64_t bytes = number_in(group / "memory.max");
      if (bytes > 0 && (least == 0 || bytes < least)) least = bytes;
    }
  }
  return least;
}

}  // namespace

int64_t machine_memory_bytes() {
  const int64_t pages = ::sysconf(_SC_PHYS_PAGES);
  const int64_t all = pages > 0 ? pages * ::sysconf(_SC_PAGESIZE) : 0;
  const int64_t of_group = group_limit_bytes();
  // A limit of version 1 that is none is a number above all memory.
  const int64_t of_old_group = number_in("/sys/fs/cgroup/memory/memory.limit_in_bytes");
  int64_t least = all;
  for (const int64_t bytes : {of_group, of_old_group}) {
    if (bytes > 0 && (least == 0 || bytes < least)) least = bytes;
  }
  return least;
}

int64_t resident_bytes() {
  return status_bytes("VmRSS:");
}

void release_free_memory() {
#ifdef __GLIBC__
  ::malloc_trim(0);
#endif
}

PeakMemory::PeakMemory() {
  std::ofstream("/proc/self/clear_refs") << "5";
}

int64_t peak_resident_bytes() {
  if (const int64_t peak = status_bytes("VmHWM:"); peak > 0) return peak;
  rusage usage{};
  return ::getrusage(RUSAGE_SELF, &usage) == 0 ? usage.ru_maxrss * kKibi : 0;
}

}  // namespace voxeld
