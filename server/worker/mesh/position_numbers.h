// Merges vertices with equal positions.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"

namespace voxeld {

// Numbers distinct positions in the order of their first use. An open-addressing table holds
// indices into the list of positions.
class PositionNumbers {
 public:
  static constexpr uint32_t kNone = 0xffffffffu;

  // count_max: distinct positions, below 2^31.
  explicit PositionNumbers(size_t count_max) : mask_(std::bit_ceil(count_max * 2 + 2) - 1) {
    resize_in_pieces(slots_, mask_ + 1, kNone);
    positions_.reserve(count_max);
  }

  // Replaces each `used` value that is not kNone by the number of its position. The table exceeds
  // the caches, so slots are prefetched.
  void number(std::span<const glm::dvec3> positions, std::span<uint32_t> used) {
    constexpr size_t kAhead = 16;
    std::array<size_t, kAhead> slots{};
    for (size_t begin = 0; begin < used.size(); begin += kAhead) {
      cancel_point();
      const size_t count = std::min(kAhead, used.size() - begin);
      for (size_t i = 0; i < count; ++i) {
        slots[i] = hash_of(positions[begin + i] + 0.0) & mask_;
        __builtin_prefetch(&slots_[slots[i]]);
      }
      for (size_t i = 0; i < count; ++i) {
        if (used[begin + i] == kNone) continue;
        used[begin + i] = number_at(slots[i], positions[begin + i] + 0.0);
      }
    }
  }
  size_t size() const { return positions_.size(); }
  const std::vector<glm::dvec3>& positions() const { return positions_; }

 private:
  // p must have been added to +0.0, which turns -0.0 into 0.0: the same point with other bits.
  uint32_t number_at(size_t slot, const glm::dvec3& p) {
    while (slots_[slot] != kNone) {
      if (positions_[slots_[slot]] == p) return slots_[slot];
      slot = (slot + 1) & mask_;
    }
    slots_[slot] = static_cast<uint32_t>(positions_.size());
    positions_.push_back(p);
    return slots_[slot];
  }

  // Finalizer of splitmix64 (Steele, Lea, Flood 2014) over the three bit patterns.
  static uint64_t hash_of(const glm::dvec3& p) {
    uint64_t hash = 0;
    for (int axis = 0; axis < 3; ++axis) {
      hash += std::bit_cast<uint64_t>(p[axis]) + 0x9e3779b97f4a7c15ull;
      hash = (hash ^ (hash >> 30)) * 0xbf58476d1ce4e5b9ull;
      hash = (hash ^ (hash >> 27)) * 0x94d049bb133111ebull;
      hash ^= hash >> 31;
    }
    return hash;
  }

  std::vector<uint32_t> slots_;
  size_t mask_ = 0;
  std::vector<glm::dvec3> positions_;
};

}  // namespace voxeld
