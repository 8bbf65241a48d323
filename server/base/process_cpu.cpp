#include "server/base/process_cpu.h"

#include <sys/types.h>
#include <time.h>

namespace voxeld {

double process_cpu_seconds(int64_t pid) {
  clockid_t clock{};
  timespec time{};
  if (::clock_getcpuclockid(static_cast<pid_t>(pid), &clock) != 0) return -1;
  if (::clock_gettime(clock, &time) != 0) return -1;
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec) * 1e-9;
}

}  // namespace voxeld
