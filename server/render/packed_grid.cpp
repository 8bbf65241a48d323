#include "server/render/packed_grid.h"

#include <glm/common.hpp>
#include <limits>

#include "server/base/check.h"
#include "shaders/shared/raymarch.h"

namespace voxeld {
namespace {

static_assert(limits::kBrickSide == 1 << RAYMARCH_BRICK_SHIFT);
static_assert(limits::kTileSide % (1 << RAYMARCH_BLOCK_SHIFT) == 0);

glm::ivec3 ceil_shift(const glm::ivec3& dims, int shift) {
  return (dims + ((1 << shift) - 1)) >> shift;
}

size_t linear_index(const glm::ivec3& p, const glm::ivec3& dims) {
  return static_cast<size_t>(p.x) +
         static_cast<size_t>(dims.x) *
             (static_cast<size_t>(p.y) + static_cast<size_t>(dims.y) * static_cast<size_t>(p.z));
}

// Grows the box by the voxels of one brick; a brick inside the box costs nothing.
void grow_box(const BrickMask& mask, const glm::ivec3& base, glm::ivec3& box_min,
              glm::ivec3& box_max) {
  if (base.x >= box_min.x && base.y >= box_min.y && base.z >= box_min.z &&
      base.x + limits::kBrickSide <= box_max.x && base.y + limits::kBrickSide <= box_max.y &&
      base.z + limits::kBrickSide <= box_max.z) {
    return;
  }
  for (uint32_t word = 0; word < 8; ++word) {
    for (uint64_t bits = mask.words[word]; bits != 0; bits &= bits - 1) {
      const auto cell = morton_decode(word * 64 + static_cast<uint32_t>(__builtin_ctzll(bits)));
      const glm::ivec3 p = base + glm::ivec3(cell[0], cell[1], cell[2]);
      box_min = glm::min(box_min, p);
      box_max = glm::max(box_max, p + 1);
    }
  }
}

void add_brick(const SparseTile& tile, size_t brick, PackedGrid& packed) {
  const auto in_tile = morton_decode(tile.brick_morton[brick]);
  constexpr int kBricksPerTile = limits::kTileSide / limits::kBrickSide;
  const glm::ivec3 position =
      glm::ivec3(tile.coord[0], tile.coord[1], tile.coord[2]) * kBricksPerTile +
      glm::ivec3(in_tile[0], in_tile[1], in_tile[2]);
  VOXELD_CHECK(position.x >= 0 && position.y >= 0 && position.z >= 0 &&
                   position.x < packed.brick_dims.x && position.y < packed.brick_dims.y &&
                   position.z < packed.brick_dims.z,
               "a brick outside the grid");
  const BrickMask& mask = tile.masks[brick];
  grow_box(mask, position * limits::kBrickSide, packed.occupied_min, packed.occupied_max);
  packed.brick_offsets.push_back(static_cast<uint32_t>(packed.voxel_count));
  for (const uint64_t word : mask.words) {
    packed.brick_masks.push_back(static_cast<uint32_t>(word));
    packed.brick_masks.push_back(static_cast<uint32_t>(word >> 32));
    packed.voxel_count += static_cast<uint64_t>(__builtin_popcountll(word));
  }
  packed.brick_index[linear_index(position, packed.brick_dims)] =
      static_cast<uint32_t>(packed.brick_offsets.size());
  const size_t block =
      linear_index(position >> (RAYMARCH_BLOCK_SHIFT - RAYMARCH_BRICK_SHIFT), packed.block_dims);
  packed.block_bits[block / 32] |= 1u << (block % 32);
}

}  // namespace

Result<PackedGrid> pack_grid(const Grid& grid) {
  if (grid.voxel_count() > std::numeric_limits<uint32_t>::max()) {
    return Error{ErrorCode::kGridTooLarge, "the grid has too many voxels to render",
                 "fewer than 2^32 voxels", std::to_string(grid.voxel_count())};
  }
  PackedGrid packed;
  packed.spec = grid.spec;
  packed.has_color = grid.has_color;
  packed.has_normal = grid.has_normal;
  packed.brick_dims = ceil_shift(grid.spec.dims, RAYMARCH_BRICK_SHIFT);
  packed.block_dims = ceil_shift(grid.spec.dims, RAYMARCH_BLOCK_SHIFT);
  packed.brick_index.resize(linear_index({0, 0, packed.brick_dims.z}, packed.brick_dims));
  packed.block_bits.resize(linear_index({0, 0, packed.block_dims.z}, packed.block_dims) / 32 + 1);
  packed.occupied_min = glm::ivec3(std::numeric_limits<int>::max());
  packed.occupied_max = glm::ivec3(std::numeric_limits<int>::min());
  for (const SparseTile& tile : grid.tiles) {
    for (size_t brick = 0; brick < tile.masks.size(); ++brick) add_brick(tile, brick, packed);
    for (size_t i = 0; grid.has_color && i + 4 <= tile.color.size(); i += 4) {
      const uint8_t* c = &tile.color[i];
      packed.colors.push_back(c[0] | uint32_t{c[1]} << 8 | uint32_t{c[2]} << 16 |
                              uint32_t{c[3]} << 24);
    }
    for (size_t i = 0; grid.has_normal && i + 3 <= tile.normal.size(); i += 3) {
      const auto byte = [&](size_t k) {
        return uint32_t{static_cast<uint8_t>(tile.normal[i + k])};
      };
      packed.normals.push_back(byte(0) | byte(1) << 8 | byte(2) << 16);
    }
  }
  VOXELD_CHECK(!grid.has_color || packed.colors.size() == packed.voxel_count, "a colour per voxel");
  VOXELD_CHECK(!grid.has_normal || packed.normals.size() == packed.voxel_count,
               "a normal per voxel");
  if (packed.voxel_count == 0) {
    packed.occupied_min = glm::ivec3(0);
    packed.occupied_max = grid.spec.dims;
  }
  return packed;
}

}  // namespace voxeld
