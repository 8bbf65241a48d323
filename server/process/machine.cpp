#include "server/process/machine.h"

#include <malloc.h>
#include <sys/resource.h>
#include <sys/types.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <thread>

namespace voxeld {

std::string cpu_model() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (!line.starts_with("model name")) continue;
    const size_t start = line.find_first_not_of(": \t", line.find(':'));
    if (start != std::string::npos) return line.substr(start);
  }
  utsname name{};
  return ::uname(&name) == 0 ? name.machine : "unknown processor";
}

int cpu_thread_count() {
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

namespace {

constexpr int64_t kKibi = 1024;

// Between daemons (0) and the first process to be killed (1000).
constexpr int kOomScore = 500;

// The value of a line such as "VmHWM:       504484 kB", in bytes.
int64_t status_bytes(std::string_view name, const std::string& process = "self") {
  std::ifstream status("/proc/" + process + "/status");
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

// The number in the file; 0 if there is none, also for "max".
int64_t number_in(const std::filesystem::path& path) {
  std::ifstream file(path);
  int64_t value = 0;
  return file >> value ? value : 0;
}

// memory.max of this process's control group and of its ancestors (version 2), or of the root that
// a container sees (version 1).
int64_t control_group_bytes() {
  const std::filesystem::path root = "/sys/fs/cgroup";
  std::ifstream own("/proc/self/cgroup");
  int64_t least = number_in(root / "memory/memory.limit_in_bytes");
  for (std::string line; std::getline(own, line);) {
    if (!line.starts_with("0::/")) continue;
    std::filesystem::path group = root / line.substr(4);
    for (; group.native().size() >= root.native().size(); group = group.parent_path()) {
      const int64_t bytes = number_in(group / "memory.max");
      if (bytes > 0 && (least == 0 || bytes < least)) least = bytes;
    }
  }
  return least;
}

}  // namespace

int64_t private_bytes(int64_t pid) {
  const std::string process = std::to_string(pid);
  return status_bytes("RssAnon:", process) + status_bytes("RssShmem:", process);
}

int64_t memory_limit_bytes() {
  const int64_t pages = ::sysconf(_SC_PHYS_PAGES), page = ::sysconf(_SC_PAGESIZE);
  const int64_t machine = pages > 0 && page > 0 ? pages * page : 0;
  const int64_t group = control_group_bytes();
  return group > 0 && (machine == 0 || group < machine) ? group : machine;
}

void offer_to_oom_killer() {
  std::ofstream("/proc/self/oom_score_adj") << kOomScore;
}

std::string memory_text(int64_t bytes) {
  char text[32];
  constexpr double kMega = 1e6, kGiga = 1e9;
  const auto count = static_cast<double>(bytes);
  if (count < kGiga) {
    std::snprintf(text, sizeof text, "%.0f MB", count / kMega);
  } else {
    std::snprintf(text, sizeof text, "%.1f GB", count / kGiga);
  }
  return text;
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

double process_cpu_seconds(int64_t pid) {
  clockid_t clock{};
  timespec time{};
  if (::clock_getcpuclockid(static_cast<pid_t>(pid), &clock) != 0) return -1;
  if (::clock_gettime(clock, &time) != 0) return -1;
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec) * 1e-9;
}

}  // namespace voxeld
