// Exact squared Euclidean distances in a box of cells.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "server/voxel/solid/distance/lower_envelope.h"

namespace voxeld {

// A box of cells [0, size), some of them set, and the cube [first, first + side) in it. Distances
// are wanted within the cube.
struct DistanceBox {
  glm::ivec3 size{0}, first{0};
  int side = 0;
};

struct DistanceScratch {
  std::vector<uint8_t> row;
  std::vector<uint32_t> of_rows, of_planes;
  std::vector<uint32_t> line, result;
  LowerEnvelope envelope;
};

// Writes the squared distance from each cell's centre to that of the nearest set cell of the box,
// for every cell of the cube (x fastest, then y, then z). Sides are at most 4096 cells. fill_row(y,
// z, row) sets a row of the box to 0 and 1. It works along x, y, z in turn, each in linear time:
// Meijster, Roerdink & Hesselink 2000, "A general algorithm for computing distance transforms in
// linear time"; Felzenszwalb & Huttenlocher 2012, "Distance transforms of sampled functions".
void squared_distances(const DistanceBox& box,
                       const std::function<void(int, int, std::span<uint8_t>)>& fill_row,
                       DistanceScratch& scratch, std::vector<uint32_t>& out);

}  // namespace voxeld
