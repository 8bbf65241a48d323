// CPU time of another process, as the kernel counts it.
#pragma once

#include <cstdint>

namespace voxeld {

// CPU seconds of all threads of the process since it started; negative if there is no such process.
// The kernel's count is used because a process's own report cannot be trusted.
double process_cpu_seconds(int64_t pid);

}  // namespace voxeld
