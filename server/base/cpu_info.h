// The processor that this runs on.
#pragma once

#include <string>

namespace voxeld {

// "AMD EPYC 9B14", as the kernel names it; the architecture where it names none.
std::string cpu_model();

// Processors that the scheduler offers, at least 1.
int cpu_thread_count();

}  // namespace voxeld
