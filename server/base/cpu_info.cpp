#include "server/base/cpu_info.h"

#include <sys/utsname.h>

#include <algorithm>
#include <fstream>
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

}  // namespace voxeld
