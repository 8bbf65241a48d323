// The cells of a box that a triangle touches, for a vector of columns at a time: the tests of
// shaders/lib/touch.glsl. Included by attribute_kernel_body.h.
#pragma once

#include "server/base/simd/lanes.h"
#include "server/voxel/cpu/kernels/attributes/attribute_kernel.h"

namespace voxeld {
namespace {

using UintLanes = uint32_t __attribute__((vector_size(VOXELD_LANE_BYTES)));
using HalfInts = int32_t __attribute__((vector_size(VOXELD_LANE_BYTES / 2)));
using LongLanes = int64_t __attribute__((vector_size(VOXELD_LANE_BYTES)));
using UlongLanes = uint64_t __attribute__((vector_size(VOXELD_LANE_BYTES)));

IntLanes lanes_at(const int32_t* from) {
  IntLanes v;
  __builtin_memcpy(&v, from, sizeof v);
  return v;
}
template <typename Lanes, typename Value>
void store(const Lanes& v, Value* to) {
  __builtin_memcpy(to, &v, sizeof v);
}
UintLanes as_unsigned(IntLanes v) {
  return reinterpret_cast<UintLanes>(v);
}
IntLanes as_signed(UintLanes v) {
  return reinterpret_cast<IntLanes>(v);
}
// The lower half of the lanes, or with 1 the upper one.
HalfInts half(const IntLanes& v, int number) {
  HalfInts out;
  __builtin_memcpy(&out, reinterpret_cast<const char*>(&v) + sizeof out * size_t(number),
                   sizeof out);
  return out;
}
LongLanes long_half(const IntLanes& v, int number) {
  return __builtin_convertvector(half(v, number), LongLanes);
}
DoubleLanes double_half(const IntLanes& v, int number) {
  return __builtin_convertvector(half(v, number), DoubleLanes);
}
// Rounds towards zero; |v| < 2^31.
HalfInts truncated(DoubleLanes v) {
  return __builtin_convertvector(v, HalfInts);
}
IntLanes joined(const HalfInts (&halves)[2]) {
  IntLanes v;
  __builtin_memcpy(&v, halves, sizeof v);
  return v;
}

IntLanes clamped(IntLanes v, int32_t low, int32_t high) {
  return lesser(greater(v, all_lanes(low)), all_lanes(high));
}

// Products of numbers that fit 32 bits.
LongLanes product(LongLanes a, int32_t b) {
#if VOXELD_LANE_BYTES == 64 && defined(__AVX512F__)
  return reinterpret_cast<LongLanes>(
      _mm512_maskz_mul_epi32(0xff, reinterpret_cast<__m512i>(a), _mm512_set1_epi64(b)));
#elif VOXELD_LANE_BYTES == 32 && defined(__AVX2__)
  return reinterpret_cast<LongLanes>(
      _mm256_mul_epi32(reinterpret_cast<__m256i>(a), _mm256_set1_epi64x(b)));
#elif VOXELD_LANE_BYTES == 16 && defined(__SSE4_1__)
  return reinterpret_cast<LongLanes>(
      _mm_mul_epi32(reinterpret_cast<__m128i>(a), _mm_set1_epi64x(b)));
#else
  return a * int64_t{b};
#endif
}

// A group of pairs.
struct Cells {
  Cells(const PairBatch& pairs, int at)
      : i(lanes_at(pairs.i + at)), j(lanes_at(pairs.j + at)), k(lanes_at(pairs.k + at)) {}
  IntLanes i, j, k;
};

// Bits 0 to 7 of a number, two apart from bit to bit.
uint32_t spread_bits(uint32_t v) {
  v = (v | v << 8) & 0x00f00fu;
  v = (v | v << 4) & 0x0c30c3u;
  return (v | v << 2) & 0x249249u;
}

uint32_t bit_count(uint32_t v) {
#if defined(__POPCNT__)
  return static_cast<uint32_t>(__builtin_popcount(v));
#else
  v -= (v >> 1) & 0x55555555u;
  v = (v & 0x33333333u) + ((v >> 2) & 0x33333333u);
  v = (v + (v >> 4)) & 0x0f0f0f0fu;
  return (v * 0x01010101u) >> 24;
#endif
}

// Appends the cells of a vector of columns to a batch.
class ColumnLanes {
 public:
  ColumnLanes(const PairTouch& t, const PairVoxels& voxels, PairBatch& pairs)
      : t_(t), voxels_(voxels), pairs_(pairs) {}

  // Sets up columns (i, j). False if the triangle's projection meets none of them.
  bool begin(IntLanes i, IntLanes j, IntLanes inside) {
    const IntLanes outside = (t_.xy[0][0] * i + t_.xy[0][1] * j + t_.xy[0][2]) |
                             (t_.xy[1][0] * i + t_.xy[1][1] * j + t_.xy[1][2]) |
                             (t_.xy[2][0] * i + t_.xy[2][1] * j + t_.xy[2][2]);
    inside = inside & ~(outside >> 31);
    if (negative_lanes(inside) == 0) return false;
    i_ = i;
    j_ = j;
    find_depth();
    // Cells of lanes that are outside end before they begin.
    last_ = inside ? last_ : first_ - 1;
    for (int e = 0; e < 3; ++e) {
      yz_[e] = t_.yz[e][0] * j + t_.yz[e][1] * first_ + t_.yz[e][2];
      zx_[e] = t_.zx[e][0] * first_ + t_.zx[e][1] * i + t_.zx[e][2];
    }
    return true;
  }

  // Appends the next cell of each column. False if there is none.
  bool next() {
    const IntLanes here = first_ <= last_;
    if (negative_lanes(here) == 0) return false;
    const IntLanes outside = yz_[0] | yz_[1] | yz_[2] | zx_[0] | zx_[1] | zx_[2];
    uint32_t touched = negative_lanes(here & ~outside);
    if (touched != 0) append(touched);
    for (int e = 0; e < 3; ++e) {
      yz_[e] += t_.yz[e][1];
      zx_[e] += t_.zx[e][0];
    }
    first_ += 1;
    return true;
  }

 private:
  // touch_depth(), with quotients of doubles. They give the exact cells: numerators are integers
  // below 2^52, the normal is below 2^38 and quotients are below 2^13, so one that is not an
  // integer is farther from one than the division and the bias round.
  void find_depth() {
    if (t_.normal[2] == 0) {
      first_ = all_lanes(t_.cell_min[2]);
      last_ = all_lanes(t_.cell_max[2]);
      return;
    }
    HalfInts first[2], last[2];
    for (int h = 0; h < 2; ++h) {
      const DoubleLanes s =
          t_.normal[0] * double_half(i_, h) + t_.normal[1] * double_half(j_, h) + t_.plane;
      // The bias makes quotients positive, so that they are rounded down.
      constexpr double kBias = 1 << 13;
      first[h] = (1 << 13) - truncated((s + t_.above) / t_.normal[2] + kBias);
      last[h] = truncated((t_.below - s) / t_.normal[2] + kBias) - (1 << 13);
    }
    first_ = greater(joined(first) + t_.base_z, all_lanes(t_.cell_min[2]));
    last_ = lesser(joined(last) + t_.base_z, all_lanes(t_.cell_max[2]));
  }

  void append(uint32_t touched) {
    int32_t i[kLanes], j[kLanes], k[kLanes];
    store(i_, i);
    store(j_, j);
    store(first_, k);
    for (; touched != 0; touched &= touched - 1) {
      const int lane = __builtin_ctz(touched);
      const uint32_t m = spread_bits(static_cast<uint32_t>(i[lane])) << (t_.axis + 1) % 3 |
                         spread_bits(static_cast<uint32_t>(j[lane])) << (t_.axis + 2) % 3 |
                         spread_bits(static_cast<uint32_t>(k[lane])) << t_.axis;
      const uint32_t word = voxels_.mask[m >> 5], bit = 1u << (m & 31u);
      if ((word & bit) == 0) continue;
      const int n = pairs_.count++;
      pairs_.i[n] = i[lane];
      pairs_.j[n] = j[lane];
      pairs_.k[n] = k[lane];
      pairs_.voxel[n] = static_cast<uint32_t>(voxels_.word_offsets[m >> 5] +
                                              bit_count(word & (bit - 1u)) - voxels_.voxel_first);
    }
  }

  const PairTouch& t_;
  const PairVoxels& voxels_;
  PairBatch& pairs_;
  IntLanes i_{}, j_{}, first_{}, last_{};
  IntLanes yz_[3]{}, zx_[3]{};
};

// Calls `take` with the touched and occupied cells of the box, at most kPairsMax at a time.
template <typename Take>
void for_each_batch(const PairTouch& t, const PairVoxels& voxels, PairBatch& pairs,
                    const Take& take) {
  pairs.count = 0;
  ColumnLanes columns(t, voxels, pairs);
  const int width = t.cell_max[0] - t.cell_min[0] + 1;
  const int rows = t.cell_max[1] - t.cell_min[1] + 1;
  // Lanes are columns of consecutive rows, counted from the box's corner.
  const IntLanes numbers = lane_numbers();
  IntLanes j = numbers / width;
  IntLanes i = numbers - j * width;
  const int step_j = kLanes / width, step_i = kLanes % width;
  for (int done = 0; done < width * rows; done += kLanes) {
    if (columns.begin(i + t.cell_min[0], j + t.cell_min[1], j < rows)) {
      while (columns.next()) {
        if (pairs.count <= kPairsMax - kLanes) continue;
        take();
        pairs.count = 0;
      }
    }
    i += step_i;
    j += step_j;
    const IntLanes beyond = i >= width;
    i -= beyond & width;
    j -= beyond;
  }
  if (pairs.count > 0) take();
}

}  // namespace
}  // namespace voxeld
