#include "tests/gpu/render/test_grids.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <random>

namespace voxeld {
namespace {

void add_brick(SparseTile& tile, uint32_t brick_morton, const glm::ivec3& dims, const VoxelAt& at,
               bool has_color, bool has_normal) {
  const auto brick = morton_decode(brick_morton);
  BrickMask mask;
  bool any = false;
  for (uint32_t bit = 0; bit < 512; ++bit) {
    const auto in_brick = morton_decode(bit);
    glm::ivec3 cell;
    for (int axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<size_t>(axis);
      cell[axis] = tile.coord[i] * limits::kTileSide + static_cast<int>(brick[i] * 8 + in_brick[i]);
    }
    if (cell.x >= dims.x || cell.y >= dims.y || cell.z >= dims.z) continue;
    const auto voxel = at(cell);
    if (!voxel) continue;
    any = true;
    mask.words[bit / 64] |= uint64_t{1} << (bit % 64);
    if (has_color) tile.color.insert(tile.color.end(), voxel->color.begin(), voxel->color.end());
    if (has_normal)
      tile.normal.insert(tile.normal.end(), voxel->normal.begin(), voxel->normal.end());
  }
  if (!any) return;
  tile.brick_morton.push_back(brick_morton);
  tile.masks.push_back(mask);
}

}  // namespace

Grid make_test_grid(const GridSpec& spec, bool has_color, bool has_normal, const VoxelAt& at) {
  Grid grid;
  grid.spec = spec;
  grid.channels.color = has_color;
  grid.channels.normal = has_normal;
  const glm::ivec3 tiles = (spec.dims + (limits::kTileSide - 1)) / limits::kTileSide;
  constexpr uint32_t kBricks = 32 * 32 * 32;
  for (int z = 0; z < tiles.z; ++z) {
    for (int y = 0; y < tiles.y; ++y) {
      for (int x = 0; x < tiles.x; ++x) {
        SparseTile tile;
        tile.coord = {x, y, z};
        for (uint32_t brick = 0; brick < kBricks; ++brick) {
          const auto p = morton_decode(brick);
          if (x * 256 + static_cast<int>(p[0]) * 8 < spec.dims.x &&
              y * 256 + static_cast<int>(p[1]) * 8 < spec.dims.y &&
              z * 256 + static_cast<int>(p[2]) * 8 < spec.dims.z) {
            add_brick(tile, brick, spec.dims, at, has_color, has_normal);
          }
        }
        if (!tile.masks.empty()) grid.tiles.push_back(std::move(tile));
      }
    }
  }
  return grid;
}

Grid sphere_grid(int side, bool has_color, bool has_normal) {
  GridSpec spec;
  spec.dims = glm::ivec3(side);
  spec.origin_world = glm::dvec3(-1.0);
  spec.voxel_size = glm::dvec3(2.0 / side);
  const double middle = 0.5 * side, radius = middle - 1.0;
  return make_test_grid(spec, has_color, has_normal,
                        [=](const glm::ivec3& cell) -> std::optional<TestVoxel> {
                          const glm::dvec3 offset = glm::dvec3(cell) + 0.5 - middle;
                          const double distance = glm::length(offset);
                          if (distance > radius || distance < radius - 1.0) return std::nullopt;
                          TestVoxel voxel;
                          for (int axis = 0; axis < 3; ++axis) {
                            const double n = offset[axis] / distance;
                            const auto i = static_cast<size_t>(axis);
                            voxel.normal[i] = static_cast<int8_t>(std::lround(127 * n));
                            voxel.color[i] = static_cast<uint8_t>(std::lround(127.5 + 127.5 * n));
                          }
                          voxel.color[3] = 255;
                          return voxel;
                        });
}

Grid noise_grid(const GridSpec& spec, double density, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit;
  return make_test_grid(spec, false, false, [&](const glm::ivec3&) -> std::optional<TestVoxel> {
    if (unit(random) >= density) return std::nullopt;
    return TestVoxel{};
  });
}

}  // namespace voxeld
