// Tiles of shapes in integers, the same on every machine.
#pragma once

#include <cstdint>
#include <random>

#include "proto/codec/bit_volume.h"
#include "proto/codec/sparse_tile.h"

namespace voxeld::test {

// The canonical tile of the cells where is_set(x, y, z).
template <typename IsSet>
SparseTile tile_where(IsSet&& is_set) {
  SparseTile tile;
  for (uint32_t morton = 0; morton < 32 * 32 * 32; ++morton) {
    const auto brick = morton_decode(morton);
    BrickMask mask;
    for (uint32_t i = 0; i < 512; ++i) {
      const auto cell = morton_decode(i);
      if (is_set(static_cast<int>(8 * brick[0] + cell[0]), static_cast<int>(8 * brick[1] + cell[1]),
                 static_cast<int>(8 * brick[2] + cell[2]))) {
        mask.words[i / 64] |= uint64_t{1} << (i % 64);
      }
    }
    if (mask == BrickMask{}) continue;
    tile.brick_morton.push_back(morton);
    tile.masks.push_back(mask);
  }
  canonicalize(tile);
  return tile;
}

// A shell of cells about `radius` from the middle, about `thickness` thick.
inline SparseTile sphere_shell(int radius, int thickness) {
  return tile_where([=](int x, int y, int z) {
    const int dx = 2 * x - 255, dy = 2 * y - 255, dz = 2 * z - 255;
    const int d = dx * dx + dy * dy + dz * dz;
    const int low = 2 * radius, high = 2 * (radius + thickness);
    return d >= low * low && d < high * high;
  });
}

inline SparseTile ball(int radius) {
  return sphere_shell(0, radius);
}

// Cells that the plane a x + b y + c z = d passes through.
inline SparseTile plane(int a, int b, int c, int d) {
  return tile_where([=](int x, int y, int z) {
    const int at = a * x + b * y + c * z;
    return at <= d && at + a + b + c > d;
  });
}

inline SparseTile checkerboard() {
  return tile_where([](int x, int y, int z) { return ((x ^ y ^ z) & 1) != 0; });
}

inline SparseTile full_tile() {
  return tile_where([](int, int, int) { return true; });
}

inline SparseTile single_voxel(int x, int y, int z) {
  SparseTile tile;
  const uint32_t morton =
      morton_encode(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z));
  tile.brick_morton = {morton >> 9};
  tile.masks.resize(1);
  tile.masks[0].words[morton >> 6 & 7] = uint64_t{1} << (morton & 63);
  return tile;
}

// About one cell of `one_in`.
inline SparseTile noise(uint32_t seed, uint32_t one_in) {
  std::mt19937 random(seed);
  return tile_where([&](int, int, int) { return random() % one_in == 0; });
}

}  // namespace voxeld::test
