// Masks of the entries of a VDB node, and the signs of entries off the surface.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace voxeld::vdb {

// A bit for each entry of a cube of 2^kLog2Side entries on a side. Entry x, y, z is bit
// (x << 2 kLog2Side) + (y << kLog2Side) + z.
template <size_t kLog2Side>
struct NodeMask {
  static constexpr size_t kSide = size_t{1} << kLog2Side;
  static constexpr size_t kBits = size_t{1} << (3 * kLog2Side);

  std::array<uint64_t, kBits / 64> words{};

  static constexpr size_t bit(size_t x, size_t y, size_t z) {
    return (x << (2 * kLog2Side)) + (y << kLog2Side) + z;
  }
  static constexpr std::array<int32_t, 3> entry(size_t bit) {
    return {static_cast<int32_t>(bit >> (2 * kLog2Side)),
            static_cast<int32_t>(bit >> kLog2Side & (kSide - 1)),
            static_cast<int32_t>(bit & (kSide - 1))};
  }
  bool test(size_t bit) const { return (words[bit / 64] >> (bit % 64) & 1) != 0; }
  void set(size_t bit, bool on = true) {
    const uint64_t only = uint64_t{1} << (bit % 64);
    words[bit / 64] = on ? words[bit / 64] | only : words[bit / 64] & ~only;
  }
  size_t count() const {
    size_t bits = 0;
    for (const uint64_t word : words) bits += static_cast<size_t>(std::popcount(word));
    return bits;
  }
  bool any() const { return words != decltype(words){}; }
  // Calls visit(bit) for each set bit, ascending.
  template <typename Visit>
  void for_each(Visit&& visit) const {
    for (size_t w = 0; w < words.size(); ++w) {
      for (uint64_t bits = words[w]; bits != 0; bits &= bits - 1) {
        visit(64 * w + static_cast<size_t>(std::countr_zero(bits)));
      }
    }
  }
};

// The entries that are inside a surface, of those that are not `known`. No surface lies between two
// neighbours of which one is unknown, so an unknown entry takes the sign of the one before it along
// z; at z = 0 along y; there along x; the first ones take that of the first known entry. `first`
// and `last`: whether the first and last cell of a known entry are inside; these are corners, so
// they touch the neighbours. At least one entry is known.
template <size_t kLog2Side>
NodeMask<kLog2Side> flood_signs(const NodeMask<kLog2Side>& known, const NodeMask<kLog2Side>& first,
                                const NodeMask<kLog2Side>& last) {
  using Mask = NodeMask<kLog2Side>;
  Mask inside;
  size_t start = 0;
  while (known.words[start] == 0) ++start;
  start = 64 * start + static_cast<size_t>(std::countr_zero(known.words[start]));
  bool along_x = first.test(start);
  for (size_t x = 0; x < Mask::kSide; ++x) {
    bool along_y = along_x;
    for (size_t y = 0; y < Mask::kSide; ++y) {
      bool along_z = along_y;
      for (size_t z = 0; z < Mask::kSide; ++z) {
        const size_t bit = Mask::bit(x, y, z);
        if (known.test(bit)) {
          along_z = last.test(bit);
        } else if (along_z) {
          inside.set(bit);
        }
        if (z == 0) along_y = along_z;
      }
      if (y == 0) along_x = along_y;
    }
  }
  return inside;
}

// The last entry of those within `sides` of the axes, which are 1 or more.
template <size_t kLog2Side>
size_t last_bit(const std::array<int32_t, 3>& sides) {
  using Mask = NodeMask<kLog2Side>;
  std::array<size_t, 3> last{};
  for (size_t c = 0; c < 3; ++c) last[c] = std::min(Mask::kSide, static_cast<size_t>(sides[c])) - 1;
  return Mask::bit(last[0], last[1], last[2]);
}

// Clears the entries beyond `sides` of the axes.
template <size_t kLog2Side>
void keep_within(NodeMask<kLog2Side>& mask, const std::array<int32_t, 3>& sides) {
  constexpr auto kSide = static_cast<int32_t>(NodeMask<kLog2Side>::kSide);
  if (sides[0] >= kSide && sides[1] >= kSide && sides[2] >= kSide) return;
  NodeMask<kLog2Side> kept;
  mask.for_each([&](size_t bit) {
    const auto at = mask.entry(bit);
    if (at[0] < sides[0] && at[1] < sides[1] && at[2] < sides[2]) kept.set(bit);
  });
  mask = kept;
}

}  // namespace voxeld::vdb
