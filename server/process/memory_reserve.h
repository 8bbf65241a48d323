// A memory reserve for the moment when memory runs out.
//
// If operator new gets no memory, the reserve is released and the allocation is retried. The first
// failures therefore do not throw. That matters in destructors that allocate (those of
// nlohmann-json 3.11.2 do), where an exception would end the process. Meanwhile the process takes
// no new work, and the reserve is restored as soon as possible.
#pragma once

#include <cstddef>

namespace voxeld {

// Enough for running work to end and to report.
constexpr size_t kMemoryReserveBytes = size_t{4} << 20;

// Allocates a reserve of `bytes`, replacing an earlier one, and installs the process's new handler
// (std::set_new_handler). 0 removes both. Calls must not be concurrent.
void hold_memory_reserve(size_t bytes = kMemoryReserveBytes);

// Whether the reserve is complete, or could just be restored. True if none was ever held.
// Thread-safe.
bool memory_reserve_is_whole();

}  // namespace voxeld
