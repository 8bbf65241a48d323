// Memory that is set aside for the moment when there is none.
//
// Where operator new gets nothing, the reserve is let go and it tries again. So the first failures
// do not throw: not where nobody expects it either, such as in destructors that allocate (those of
// nlohmann-json 3.11.2 do) and would end the process. Meanwhile the process takes no new work, and
// the reserve is taken back as soon as that works.
#pragma once

#include <cstddef>

namespace voxeld {

// Enough for what runs to end and to say so.
constexpr size_t kMemoryReserveBytes = size_t{4} << 20;

// Takes `bytes` aside, in the place of an earlier reserve, and installs the handler
// (std::set_new_handler) for the whole process; 0: none any more. Not beside other calls of it.
void hold_memory_reserve(size_t bytes = kMemoryReserveBytes);

// Whether the reserve is whole, or could just be made whole again. True where none was ever held.
// Thread-safe.
bool memory_reserve_is_whole();

}  // namespace voxeld
