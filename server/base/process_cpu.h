// CPU time of another process, as the kernel counts it.
#pragma once

#include <cstdint>

namespace voxeld {

// Seconds that all threads of the process have run since it started; negative: there is no such
// process. What a process says of itself need not be believed.
double process_cpu_seconds(int64_t pid);

}  // namespace voxeld
