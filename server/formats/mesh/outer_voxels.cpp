#include "server/formats/mesh/outer_voxels.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <string>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/base/parallel.h"
#include "server/formats/bricks/voxel_bricks.h"
#include "server/formats/bricks/voxel_lookup.h"

namespace voxeld::mesh {
namespace {

constexpr float kCentre = 0.5F;  // of a cell

Planes outer_cells(const VoxelBricks& voxels, uint32_t tile, const std::array<int, 3>& brick) {
  Planes cells{};
  for (uint32_t axis = 0; axis < 3; ++axis) {
    for (const bool up : {false, true}) {
      const Planes faces = voxels.open_faces(tile, brick, axis, up);
      for (size_t z = 0; z < cells.size(); ++z) cells[z] |= faces[z];
    }
  }
  return cells;
}

std::vector<Vertex> cubes_of_tile(const VoxelBricks& voxels, const VoxelColors& colors,
                                  uint32_t tile) {
  std::vector<Vertex> cubes;
  VoxelLookup lookup(voxels);
  const BrickIndex::Tile& bricks = voxels.index().tiles()[tile];
  for_each_brick_of(bricks.rows, [&](int x, int y, int z) {
    const std::array<int, 3> brick = {x, y, z};
    const Planes cells = outer_cells(voxels, tile, brick);
    for (int plane = 0; plane < limits::kBrickSide; ++plane) {
      for (uint64_t bits = cells[static_cast<size_t>(plane)]; bits != 0; bits &= bits - 1) {
        const int bit = std::countr_zero(bits);
        std::array<int, 3> cell = {bit & 7, bit >> 3, plane};
        Vertex cube{};
        for (size_t c = 0; c < 3; ++c) {
          cell[c] += bricks.coord[c] * limits::kTileSide + brick[c] * limits::kBrickSide;
          cube.p_grid[c] = static_cast<float>(cell[c]) + kCentre;
        }
        cube.color = colors.other();
        if (const auto voxel = lookup.at(cell); voxel && colors.several()) {
          cube.color = colors.of(*voxel->tile, voxel->attribute);
        }
        cubes.push_back(cube);
      }
    }
  });
  return cubes;
}

}  // namespace

Result<UnsetArray<Vertex>> outer_voxels(const Grid& grid, std::string_view format,
                                        uint64_t count_max) {
  const VoxelBricks voxels(grid);
  const VoxelColors colors(grid);
  std::vector<std::vector<Vertex>> by_tile(grid.tiles.size());
  std::atomic<uint64_t> count{0};
  parallel_for(by_tile.size(), [&](size_t tile) {
    cancel_point();
    if (count.load(std::memory_order_relaxed) > count_max) return;
    by_tile[tile] = cubes_of_tile(voxels, colors, static_cast<uint32_t>(tile));
    count.fetch_add(by_tile[tile].size(), std::memory_order_relaxed);
  });
  if (count.load() > count_max) {
    return Error{ErrorCode::kGridTooLarge, std::string(format) + ": too many cubes for a mesh",
                 "at most " + std::to_string(count_max), "more"};
  }
  std::vector<uint64_t> begins(by_tile.size());
  uint64_t begin = 0;
  for (size_t i = 0; i < by_tile.size(); ++i) {
    begins[i] = begin;
    begin += by_tile[i].size();
  }
  UnsetArray<Vertex> cubes(begin);
  parallel_for(by_tile.size(), [&](size_t i) {
    cancel_point();
    if (!by_tile[i].empty()) std::ranges::copy(by_tile[i], &cubes[begins[i]]);
  });
  return cubes;
}

}  // namespace voxeld::mesh
