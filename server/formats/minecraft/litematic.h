// The packed indices of a .litematic.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace voxeld::minecraft {

// Bits of an index into a palette of so many names: enough for all, at least 2.
unsigned index_bits(size_t names);

// Replaces `bytes` by the indices, packed into big-endian longs without gaps: index i is in the
// bits i * bits and up, counted from the lowest bit of the first long, so it may span two longs.
// The last long is filled up with zeros. bits: 2..8.
void pack_indices(std::span<const uint8_t> indices, unsigned bits, std::vector<uint8_t>& bytes);

}  // namespace voxeld::minecraft
