// Samples of dense arrays changed eight bytes at a time: most of them are those of empty cells.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace voxeld::images {

inline uint64_t load_word(const uint8_t* at) {
  uint64_t word = 0;
  std::memcpy(&word, at, sizeof word);
  return word;
}

// Writes 0 and 255 for 0 and 1. `out` may be where the samples are.
inline void to_full_range(std::span<const uint8_t> samples, uint8_t* out) {
  const size_t words_end = samples.size() / sizeof(uint64_t) * sizeof(uint64_t);
  for (size_t at = 0; at < words_end; at += sizeof(uint64_t)) {
    const uint64_t word = load_word(&samples[at]) * UINT8_MAX;  // no byte carries
    std::memcpy(out + at, &word, sizeof word);
  }
  for (size_t at = words_end; at < samples.size(); ++at) {
    out[at] = static_cast<uint8_t>(samples[at] * UINT8_MAX);
  }
}

// Swaps the bytes of samples of 16 bits.
inline void swap_bytes_16(std::span<const uint8_t> samples, uint8_t* out) {
  constexpr uint64_t kLowBytes = 0x00ff00ff00ff00ff;
  const size_t words_end = samples.size() / sizeof(uint64_t) * sizeof(uint64_t);
  for (size_t at = 0; at < words_end; at += sizeof(uint64_t)) {
    const uint64_t word = load_word(&samples[at]);
    const uint64_t swapped = (word & kLowBytes) << 8 | (word >> 8 & kLowBytes);
    std::memcpy(out + at, &swapped, sizeof swapped);
  }
  for (size_t at = words_end; at < samples.size(); at += 2) {
    out[at] = samples[at + 1];
    out[at + 1] = samples[at];
  }
}

// Cells of three samples that all_zero_vectors() looks at together.
inline constexpr size_t kVectorGroup = 8;
inline bool all_zero_vectors(const uint8_t* at) {
  return (load_word(at) | load_word(at + 8) | load_word(at + 16)) == 0;
}

}  // namespace voxeld::images
