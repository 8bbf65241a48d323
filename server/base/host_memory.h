// How much memory this process takes, as Linux counts it.
#pragma once

#include <cstdint>
#include <string>

namespace voxeld {

// Resident bytes now; 0 if unknown.
int64_t resident_bytes();

// The most resident bytes that are remembered; 0 if unknown.
int64_t peak_resident_bytes();

// Resident bytes of another process, or of this one, without pages that are only a file's: what it
// takes from the machine. 0 if unknown.
int64_t private_bytes(int64_t pid);

// The machine's memory, or what the control group leaves of it. 0 if unknown.
int64_t memory_limit_bytes();

// When the machine runs out of memory, the kernel ends this process before others.
void offer_to_oom_killer();

// "9.1 GB", "312 MB"
std::string memory_text(int64_t bytes);

// Gives what the allocator keeps for later back to the system.
void release_free_memory();

// The most resident bytes since it was made, or, where the kernel does not let a process forget its
// earlier peak, since the process began.
class PeakMemory {
 public:
  PeakMemory();
  int64_t bytes() const { return peak_resident_bytes(); }
};

}  // namespace voxeld
