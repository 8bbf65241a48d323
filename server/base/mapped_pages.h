// What a mapped file keeps in memory.
#pragma once

#include <cstdint>
#include <span>

namespace voxeld {

// Lets go of the whole pages of read-only mapped bytes; they come back from the file when they are
// read again. For a reader of files larger than memory. Only for bytes of a mapped file: the
// contents of other memory would be lost.
void drop_mapped_pages(std::span<const uint8_t> bytes);

}  // namespace voxeld
