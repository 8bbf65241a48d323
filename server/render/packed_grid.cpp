#include "server/render/packed_grid.h"

#include <algorithm>
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

// Place of a brick in the grid, in bricks.
glm::ivec3 brick_position(const SparseTile& tile, uint32_t brick_morton, const PackedGrid& packed) {
  const auto in_tile = morton_decode(brick_morton);
  constexpr int kBricksPerTile = limits::kTileSide / limits::kBrickSide;
  const glm::ivec3 position =
      glm::ivec3(tile.coord[0], tile.coord[1], tile.coord[2]) * kBricksPerTile +
      glm::ivec3(in_tile[0], in_tile[1], in_tile[2]);
  VOXELD_CHECK(position.x >= 0 && position.y >= 0 && position.z >= 0 &&
                   position.x < packed.brick_dims.x && position.y < packed.brick_dims.y &&
                   position.z < packed.brick_dims.z,
               "a brick outside the grid");
  return position;
}

// Enters the last packed brick, or another by its number + 1, in the tables of places.
void place_brick(const glm::ivec3& position, uint32_t entry, PackedGrid& packed) {
  packed.brick_index[linear_index(position, packed.brick_dims)] = entry;
  const size_t block =
      linear_index(position >> (RAYMARCH_BLOCK_SHIFT - RAYMARCH_BRICK_SHIFT), packed.block_dims);
  packed.block_bits[block / 32] |= 1u << (block % 32);
}

// Adds a brick's mask and gives its number + 1.
uint32_t add_mask(const BrickMask& mask, PackedGrid& packed) {
  packed.brick_offsets.push_back(static_cast<uint32_t>(packed.voxel_count));
  for (const uint64_t word : mask.words) {
    packed.brick_masks.push_back(static_cast<uint32_t>(word));
    packed.brick_masks.push_back(static_cast<uint32_t>(word >> 32));
    packed.voxel_count += static_cast<uint64_t>(__builtin_popcountll(word));
  }
  return static_cast<uint32_t>(packed.brick_offsets.size());
}

void add_brick(const SparseTile& tile, size_t brick, PackedGrid& packed) {
  const glm::ivec3 position = brick_position(tile, tile.brick_morton[brick], packed);
  const BrickMask& mask = tile.masks[brick];
  grow_box(mask, position * limits::kBrickSide, packed.occupied_min, packed.occupied_max);
  place_brick(position, add_mask(mask, packed), packed);
}

// The one brick that all bricks of full nodes share, and the attributes of its voxels: the mean
// colour, and the normal zero, for which the face's serves.
uint32_t add_full_brick(const Grid& grid, PackedGrid& packed) {
  BrickMask mask;
  mask.words.fill(~uint64_t{0});
  const uint32_t entry = add_mask(mask, packed);
  const auto color = mean_color(grid);
  const uint32_t word = color[0] | uint32_t{color[1]} << 8 | uint32_t{color[2]} << 16 | 0xff000000u;
  if (grid.has_color) packed.colors.resize(packed.voxel_count, word);
  if (grid.has_normal) packed.normals.resize(packed.voxel_count, 0);
  return entry;
}

void add_full_nodes(const SparseTile& tile, uint32_t entry, PackedGrid& packed) {
  for (const FullNode& node : tile.full) {
    for (uint32_t i = 0; i < node.brick_count(); ++i) {
      place_brick(brick_position(tile, node.brick_morton + i, packed), entry, packed);
    }
    const glm::ivec3 low = brick_position(tile, node.brick_morton, packed) * limits::kBrickSide;
    packed.occupied_min = glm::min(packed.occupied_min, low);
    packed.occupied_max = glm::max(packed.occupied_max, low + (limits::kBrickSide << node.level));
  }
}

// Voxels that need an entry in the tables of attributes, at most.
uint64_t entry_count(const Grid& grid) {
  uint64_t count = limits::kBrickSide * limits::kBrickSide * limits::kBrickSide;
  for (const SparseTile& tile : grid.tiles) count += tile.attribute_count();
  return count;
}

}  // namespace

Result<PackedGrid> pack_grid(const Grid& grid) {
  if (const uint64_t entries = entry_count(grid); entries > std::numeric_limits<uint32_t>::max()) {
    return Error{ErrorCode::kGridTooLarge, "the grid has too many voxels to render",
                 "fewer than 2^32 voxels", std::to_string(entries)};
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
  const bool has_full =
      std::ranges::any_of(grid.tiles, [](const SparseTile& tile) { return !tile.full.empty(); });
  const uint32_t full_entry = has_full ? add_full_brick(grid, packed) : 0;
  for (const SparseTile& tile : grid.tiles) {
    add_full_nodes(tile, full_entry, packed);
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
