// Canonical Huffman codes as deflate has them (RFC 1951, 3.2.2).
#pragma once

#include <cstdint>
#include <span>

namespace voxeld {

// Lengths of the codes of symbols that occur counts[i] times, at most length_max bits; 0: none.
// Symbol 0 or 1 gets a code as well if fewer than two symbols occur, so that the code is complete.
// The lengths are those of Huffman's code; codes that are too long are then shortened at the
// expense of the longest that are not.
void huffman_lengths(std::span<const uint32_t> counts, int length_max, std::span<uint8_t> lengths);

// The codes of these lengths, the first bit lowest.
void huffman_codes(std::span<const uint8_t> lengths, std::span<uint16_t> codes);

}  // namespace voxeld
