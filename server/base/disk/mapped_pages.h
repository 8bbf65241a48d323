// Releases the resident pages of a mapped file, or of memory that is no longer needed.
#pragma once

#include <cstdint>
#include <span>

namespace voxeld {

// Releases whole pages of read-only mapped bytes; a later read loads them from the file again. For
// readers of files larger than memory. Other memory loses its contents, so it must be freed next.
void drop_mapped_pages(std::span<const uint8_t> bytes);

}  // namespace voxeld
