// Facts about this machine and its processes: the processor, memory, CPU time.
#pragma once

#include <cstdint>
#include <string>

namespace voxeld {

// The kernel's name of the processor, such as "AMD EPYC 9B14", or the architecture if it has none.
std::string cpu_model();

// The number of processors that the scheduler offers, at least 1.
int cpu_thread_count();

// Resident bytes now; 0 if unknown.
int64_t resident_bytes();

// The peak of resident bytes; 0 if unknown.
int64_t peak_resident_bytes();

// Resident bytes of a process without file-backed pages: the memory it takes from the machine. 0 if
// unknown.
int64_t private_bytes(int64_t pid);

// The machine's memory, or the control group's limit if that is lower. 0 if unknown.
int64_t memory_limit_bytes();

// Makes the kernel end this process before others when the machine runs out of memory.
void offer_to_oom_killer();

// A text such as "9.1 GB" or "312 MB".
std::string memory_text(int64_t bytes);

// Returns the allocator's unused memory to the system.
void release_free_memory();

// The peak of resident bytes since construction. Some kernels do not let a process reset its peak;
// then since the process began.
class PeakMemory {
 public:
  PeakMemory();
  int64_t bytes() const { return peak_resident_bytes(); }
};

// CPU seconds of all threads of the process since it started; negative if there is no such process.
// The kernel's count is used because a process's own report cannot be trusted.
double process_cpu_seconds(int64_t pid);

}  // namespace voxeld
