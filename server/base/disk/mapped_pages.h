// Releases the resident pages of a mapped file.
#pragma once

#include <cstdint>
#include <span>

namespace voxeld {

// Releases whole pages of read-only mapped bytes; a later read loads them from the file again. For
// readers of files larger than memory. Only for bytes of a mapped file: other memory would lose its
// contents.
void drop_mapped_pages(std::span<const uint8_t> bytes);

}  // namespace voxeld
