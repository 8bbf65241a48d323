// Facts about this machine's processor.
#pragma once

#include <string>

namespace voxeld {

// The kernel's name of the processor, such as "AMD EPYC 9B14", or the architecture if it has none.
std::string cpu_model();

// The number of processors that the scheduler offers, at least 1.
int cpu_thread_count();

}  // namespace voxeld
