// The logistic function and its inverse in integers, the same on every machine.
//
// Matt Mahoney, "Adaptive weighing of context models for lossless data compression" (2005), mixes
// predictions in this domain: stretch(p) = ln(p / (1 - p)), squash its inverse.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace voxeld {

inline constexpr int kStretchOne = 256;                   // 1.0 in the stretched domain
inline constexpr int kStretchMax = 12 * kStretchOne - 1;  // beyond: clamped

// round(65536 / (1 + exp(-i / 2))) for i = -24..24.
inline constexpr std::array<int32_t, 49> kSquashAnchors = {
    0,     1,     1,     2,     3,     5,     8,     13,    22,    36,    60,    98,    162,
    267,   439,   720,   1179,  1921,  3108,  4971,  7812,  11955, 17625, 24743, 32768, 40793,
    47911, 53581, 57724, 60565, 62428, 63615, 64357, 64816, 65097, 65269, 65374, 65438, 65476,
    65500, 65514, 65523, 65528, 65531, 65533, 65534, 65535, 65535, 65536};

// The probability in 1/65536 for x in 1/256, clamped to +-kStretchMax; linear between the anchors.
constexpr int32_t squash(int32_t x) {
  constexpr int kStep = kStretchOne / 2;
  x = x < -kStretchMax ? -kStretchMax : x > kStretchMax ? kStretchMax : x;
  const auto from_low = static_cast<uint32_t>(x + 24 * kStep);
  const int32_t low = kSquashAnchors[from_low / kStep];
  const int32_t high = kSquashAnchors[from_low / kStep + 1];
  return low + (high - low) * static_cast<int32_t>(from_low % kStep) / kStep;
}

inline constexpr int kStretchTableBits = 12;

// Entry i is the least x with squash(x) >= 16 i + 8, the middle of the 16 probabilities of entry i.
constexpr std::array<int16_t, 1 << kStretchTableBits> make_stretch_table() {
  std::array<int16_t, 1 << kStretchTableBits> table{};
  int32_t x = -kStretchMax;
  for (int32_t i = 0; i < 1 << kStretchTableBits; ++i) {
    while (squash(x) < 16 * i + 8) ++x;
    table[static_cast<size_t>(i)] = static_cast<int16_t>(x);
  }
  return table;
}

inline constexpr std::array<int16_t, 1 << kStretchTableBits> kStretchTable = make_stretch_table();

}  // namespace voxeld
