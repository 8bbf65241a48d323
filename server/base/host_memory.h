// How much memory this process takes, as Linux counts it.
#pragma once

#include <cstdint>

namespace voxeld {

// Resident bytes now; 0 if unknown.
int64_t resident_bytes();

// What this machine has for processes like this one: its memory, or less where a control group says
// so (a container, a systemd unit). 0 if unknown.
int64_t machine_memory_bytes();

// The most resident bytes that are remembered; 0 if unknown.
int64_t peak_resident_bytes();

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
