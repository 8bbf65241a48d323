// The kernel of march_kernel.h for one instruction set. Operations and their order are those of
// shaders/raymarch/dda.glsl, march.glsl and march_tree.glsl, whose comments explain them: the bits
// of every distance are the same.
#pragma once

#include <bit>
#include <cstdint>

#include "server/base/simd/lanes.h"
#include "server/render/cpu/kernels/march_kernel.h"
#include "shaders/shared/raymarch.h"

namespace voxeld {
namespace {

constexpr float kFar = 3.0e38f;          // DDA_FAR
constexpr float kParallelBelow = 1e-9f;  // of the longest axis
constexpr float kBeforeSection = 0.02f;  // light_section()
// Rays wait for a free lane until so many are free.
constexpr int kFreeLanes = kLanes / 2;

// Lanes of `mask`, all bits or none, from a, the others from b.
IntLanes chosen(IntLanes mask, IntLanes a, IntLanes b) {
  return mask ? a : b;
}
FloatLanes chosen(IntLanes mask, FloatLanes a, FloatLanes b) {
  return mask ? a : b;
}
FloatLanes magnitude(FloatLanes v) {
  return reinterpret_cast<FloatLanes>(reinterpret_cast<IntLanes>(v) & 0x7fffffff);
}
// |v| < 2^31.
IntLanes floor_to_int(FloatLanes v) {
  const IntLanes down = truncated(v);
  return down + (to_float(down) > v);  // a comparison is -1
}

// base[index] in the lanes of `mask`, 0 in the others.
IntLanes gathered(const uint32_t* base, IntLanes index, IntLanes mask) {
#if VOXELD_LANE_BYTES == 64 && defined(__AVX512F__)
  return reinterpret_cast<IntLanes>(_mm512_mask_i32gather_epi32(
      _mm512_setzero_si512(), static_cast<__mmask16>(negative_lanes(mask)),
      reinterpret_cast<__m512i>(index), base, 4));
#elif VOXELD_LANE_BYTES == 32 && defined(__AVX2__)
  return reinterpret_cast<IntLanes>(_mm256_mask_i32gather_epi32(
      _mm256_setzero_si256(), reinterpret_cast<const int*>(base), reinterpret_cast<__m256i>(index),
      reinterpret_cast<__m256i>(mask), 4));
#else
  IntLanes out{};
  for (int l = 0; l < kLanes; ++l) {
    if (mask[l] != 0) out[l] = static_cast<int32_t>(base[index[l]]);
  }
  return out;
#endif
}

// The lanes of `mask` from consecutive values, the first of them for the lowest lane, the others
// from `old`.
IntLanes filled(IntLanes old, IntLanes mask, const int32_t* values) {
#if VOXELD_LANE_BYTES == 64 && defined(__AVX512F__)
  return reinterpret_cast<IntLanes>(_mm512_mask_expandloadu_epi32(
      reinterpret_cast<__m512i>(old), static_cast<__mmask16>(negative_lanes(mask)), values));
#else
  for (int l = 0; l < kLanes; ++l) {
    if (mask[l] != 0) old[l] = *values++;
  }
  return old;
#endif
}
FloatLanes filled(FloatLanes old, IntLanes mask, const float* values) {
#if VOXELD_LANE_BYTES == 64 && defined(__AVX512F__)
  return _mm512_mask_expandloadu_ps(old, static_cast<__mmask16>(negative_lanes(mask)), values);
#else
  for (int l = 0; l < kLanes; ++l) {
    if (mask[l] != 0) old[l] = *values++;
  }
  return old;
#endif
}

constexpr int32_t kChild = static_cast<int32_t>(RAYMARCH_CHILD);

struct Rays {
  IntLanes base[3], cell[3], positive[3], parallel[3];
  FloatLanes origin[3], direction[3], inverse[3], level_t[4], t, t_max, t_box;
  IntLanes axis;    // of the face through which they came
  IntLanes number;  // in MarchRays
  IntLanes steps;   // that are left
};

FloatLanes leave(const Rays& rays, int axis, IntLanes plane) {
  const FloatLanes t = (to_float(plane - rays.base[axis]) - rays.origin[axis]) * rays.inverse[axis];
  return chosen(rays.parallel[axis], all_lanes_f(kFar), t);
}

// Loads the rays from `first` on into the lanes of `mask`.
void load(const MarchTables& tables, const MarchRays& from, size_t first, IntLanes mask,
          Rays& rays) {
  const auto fill = [&](auto& lanes, const auto& values) {
    lanes = filled(lanes, mask, values.data() + first);
  };
  for (size_t c = 0; c < 3; ++c) {
    fill(rays.base[c], from.base[c]);
    fill(rays.cell[c], from.cell[c]);
    fill(rays.origin[c], from.origin[c]);
    fill(rays.direction[c], from.direction[c]);
    fill(rays.inverse[c], from.inverse[c]);
    rays.positive[c] = -(rays.direction[c] > all_lanes_f(0.0f));
    rays.parallel[c] = rays.direction[c] == all_lanes_f(0.0f);
  }
  for (size_t i = 0; i < 4; ++i) fill(rays.level_t[i], from.level_t[i]);
  fill(rays.t_max, from.t_max);
  fill(rays.steps, from.steps_max);
  rays.t = chosen(mask, FloatLanes{}, rays.t);
  rays.axis = chosen(mask, all_lanes(-1), rays.axis);
  FloatLanes box[3];
  for (int c = 0; c < 3; ++c) {
    const auto axis = static_cast<size_t>(c);
    const IntLanes plane =
        chosen(-rays.positive[c], all_lanes(tables.high[axis]), all_lanes(tables.low[axis]));
    box[c] = leave(rays, c, plane);
  }
  rays.t_box = lesser(box[0], lesser(box[1], box[2]));
}

// The level of cubes that a ray tests: march_level().
IntLanes level_of(const Rays& rays) {
  const FloatLanes t = rays.t;
  const IntLanes finer = 1 - (t >= rays.level_t[1]) - (t >= rays.level_t[2]);
  const IntLanes level = chosen(t >= rays.level_t[3], all_lanes(5), finer);
  return chosen(t < rays.level_t[0], all_lanes(0), level);
}

// Log2 of the side of the empty cube around the cell; negative: it is occupied.
IntLanes empty_shift(const MarchTables& tables, bool is_one_tile, const Rays& rays,
                     IntLanes active) {
  const IntLanes &x = rays.cell[0], &y = rays.cell[1], &z = rays.cell[2];
  const IntLanes level = level_of(rays);
  const auto tile = [](IntLanes v) { return v >> RAYMARCH_TILE_SHIFT; };
  IntLanes entry = all_lanes(static_cast<int32_t>(tables.nodes[0]));
  if (!is_one_tile) {
    const IntLanes at = tile(x) + tables.tile_dims[0] * (tile(y) + tables.tile_dims[1] * tile(z));
    entry = gathered(tables.nodes, at, active);
  }
  IntLanes is_child = active & (entry < 0);
  if (negative_lanes(is_child) != 0) {
    const auto slot = [](IntLanes v) { return v >> RAYMARCH_BLOCK_SHIFT & 7; };
    const IntLanes at = (entry & ~kChild) + slot(x) + 8 * slot(y) + 64 * slot(z);
    entry = chosen(is_child, gathered(tables.nodes, at, is_child), entry);
    // A table of bricks is looked at below level 5 alone.
    is_child &= (entry < 0) & (level < 5);
    if (negative_lanes(is_child) != 0) {
      const auto place = [](IntLanes v) { return v >> RAYMARCH_BRICK_SHIFT & 3; };
      const IntLanes brick = (entry & ~kChild) + place(x) + 4 * place(y) + 16 * place(z);
      entry = chosen(is_child, gathered(tables.nodes, brick, is_child), entry);
    }
  }
  const IntLanes is_full = (entry & static_cast<int32_t>(RAYMARCH_FULL)) != 0;
  IntLanes shift = chosen((entry < 0) | is_full, all_lanes(-1), entry);
  const IntLanes in_brick = active & (entry < 0) & (level < 3);
  if (negative_lanes(in_brick) == 0) return shift;
  const auto spread = [](IntLanes v) { return (v & 1) | (v & 2) << 2 | (v & 4) << 4; };
  const IntLanes bit = spread(x) | spread(y) << 1 | spread(z) << 2;
  const IntLanes word = (entry & ~kChild) * RAYMARCH_BRICK_WORDS + (bit >> 5);
  const IntLanes half = gathered(tables.bricks, word, in_brick);
  const IntLanes other = gathered(tables.bricks, word ^ 1, in_brick & (half == 0));
  const IntLanes in_cell = (half >> (bit & 31) & 1) != 0;
  const IntLanes in_byte = (half >> (bit & 24) & 255) != 0;
  IntLanes found =
      chosen((half | other) != 0, chosen(level == 2, all_lanes(-1), all_lanes(1)), all_lanes(2));
  found = chosen(in_byte, chosen(level == 0, all_lanes(0), all_lanes(-1)), found);
  found = chosen(in_cell & (level == 0), all_lanes(-1), found);
  return chosen(in_brick, found, shift);
}

// Steps out of the aligned blocks of 2^shift cells around the cells: dda_leave_block().
void step(Rays& rays, IntLanes shift, IntLanes active) {
  const IntLanes side = all_lanes(1) << shift;
  IntLanes low[3], plane[3];
  FloatLanes t[3];
  for (int c = 0; c < 3; ++c) {
    low[c] = rays.cell[c] & -side;
    plane[c] = low[c] + (side & -rays.positive[c]);
    t[c] = leave(rays, c, plane[c]);
  }
  const IntLanes is_x = (t[0] <= t[1]) & (t[0] <= t[2]);
  const IntLanes is_y = ~is_x & (t[1] <= t[2]);
  const IntLanes on_axis[3] = {is_x, is_y, ~(is_x | is_y)};
  const FloatLanes next = lesser(t[0], lesser(t[1], t[2]));
  for (int c = 0; c < 3; ++c) {
    IntLanes at = rays.base[c] + floor_to_int(rays.origin[c] + rays.direction[c] * next);
    at = lesser(greater(at, low[c]), low[c] + (side - 1));
    at = chosen(-rays.positive[c], greater(at, rays.cell[c]), lesser(at, rays.cell[c]));
    at = chosen(on_axis[c], plane[c] - (1 - rays.positive[c]), at);
    rays.cell[c] = chosen(active, at, rays.cell[c]);
  }
  rays.t = chosen(active, next, rays.t);
  rays.axis = chosen(active, 2 + is_y + 2 * is_x, rays.axis);
}

void march(const MarchTables& tables, MarchRays& all) {
  for (int i = 0; i < all.count; ++i) all.t[static_cast<size_t>(i)] = -1.0f;
  const bool is_one_tile = tables.tile_dims == std::array<int32_t, 3>{1, 1, 1};
  Rays rays{};
  IntLanes active{};
  int next = 0;
  while (true) {
    int free_lanes = kLanes - std::popcount(negative_lanes(active));
    if (next < all.count && free_lanes >= kFreeLanes) {
      IntLanes fresh{};
      const auto first = static_cast<size_t>(next);
      for (int l = 0; l < kLanes && next < all.count; ++l) {
        if (active[l] != 0) continue;
        fresh[l] = -1;
        rays.number[l] = next++;
      }
      load(tables, all, first, fresh, rays);
      active |= fresh & (rays.steps > 0);
      free_lanes = kLanes - std::popcount(negative_lanes(active));
    }
    if (free_lanes == kLanes) {
      if (next == all.count) return;
      continue;  // rays without a step
    }
    const IntLanes shift = empty_shift(tables, is_one_tile, rays, active);
    const IntLanes hit = active & (shift < 0);
    for (uint32_t hits = negative_lanes(hit); hits != 0; hits &= hits - 1) {
      const int l = std::countr_zero(hits);
      const auto ray = static_cast<size_t>(rays.number[l]);
      all.t[ray] = rays.t[l];
      for (size_t c = 0; c < 3; ++c) all.hit[c][ray] = rays.cell[c][l];
      all.axis[ray] = rays.axis[l];
    }
    active &= ~hit;
    step(rays, chosen(active, shift, IntLanes{}), active);
    rays.steps -= 1;
    active &= (rays.t <= rays.t_max) & (rays.t < rays.t_box) & (rays.steps > 0);
  }
}

void add_fan(const MarchFan& fan, const float* x, const float* y, const float* up, int count,
             MarchRays& rays, float* per_side) {
  const auto all = [](float value) { return all_lanes_f(value); };
  for (int first = 0; first < count; first += kLanes) {
    const int lanes = count - first < kLanes ? count - first : kLanes;
    FloatLanes dx{}, dy{}, upward{};
    for (int l = 0; l < lanes; ++l) {
      dx[l] = x[first + l];
      dy[l] = y[first + l];
      upward[l] = up[first + l];
    }
    FloatLanes cells[3];
    for (size_t c = 0; c < 3; ++c) {
      const FloatLanes world =
          all(fan.tangent[c]) * dx + all(fan.other[c]) * dy + all(fan.axis[c]) * upward;
      cells[c] = world / all(fan.scale[c]);
    }
    const FloatLanes longest =
        greater(magnitude(cells[0]), greater(magnitude(cells[1]), magnitude(cells[2])));
    FloatLanes direction[3], inverse[3], along[3];
    for (size_t c = 0; c < 3; ++c) {
      const FloatLanes d = cells[c] / longest;
      const IntLanes parallel = magnitude(d) < all(kParallelBelow);
      direction[c] = chosen(parallel, FloatLanes{}, d);
      inverse[c] = chosen(parallel, FloatLanes{}, all(1.0f) / d);
      along[c] = all(fan.section[c]) * direction[c];
    }
    // light_section()
    float at = 0;
    {
      float products[3];
      for (size_t c = 0; c < 3; ++c) {
        products[c] = fan.section[c] * (static_cast<float>(fan.base[c]) + fan.origin[c]);
      }
      at = products[0] + products[1] + products[2] + fan.section[3];
    }
    const FloatLanes per_t = along[0] + along[1] + along[2];
    const FloatLanes cut = greater(all(-at) / per_t - kBeforeSection, FloatLanes{});
    FloatLanes t_max = chosen(per_t > FloatLanes{}, cut, all(kFar));
    if (fan.length > 0) t_max = lesser(all(fan.length) * longest, t_max);
    for (int l = 0; l < lanes; ++l) {
      const size_t ray = static_cast<size_t>(rays.count) + static_cast<size_t>(l);
      for (size_t c = 0; c < 3; ++c) {
        rays.base[c][ray] = rays.cell[c][ray] = fan.base[c];
        rays.origin[c][ray] = fan.origin[c];
        rays.direction[c][ray] = direction[c][l];
        rays.inverse[c][ray] = inverse[c][l];
      }
      for (size_t i = 0; i < 4; ++i) rays.level_t[i][ray] = fan.level_t[i];
      rays.t_max[ray] = t_max[l];
      rays.steps_max[ray] = fan.steps_max;
      per_side[first + l] = longest[l];
    }
    rays.count += lanes;
  }
}

}  // namespace
}  // namespace voxeld
