#include "server/render/packed_grid.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>
#include <limits>
#include <span>

#include "server/base/cancel_point.h"
#include "server/base/check.h"
#include "server/base/pieces.h"
#include "server/render/drawing_cost.h"
#include "server/render/hull.h"
#include "server/render/mean_voxel.h"
#include "shaders/shared/raymarch.h"

namespace voxeld {
namespace {

static_assert(limits::kBrickSide == 1 << RAYMARCH_BRICK_SHIFT);
static_assert(limits::kTileSide == 1 << RAYMARCH_TILE_SHIFT);
static_assert(std::endian::native == std::endian::little, "colours are copied as words");

constexpr int kBlocksPerSide = 1 << (RAYMARCH_TILE_SHIFT - RAYMARCH_BLOCK_SHIFT);
constexpr int kBricksPerSide = 1 << (RAYMARCH_BLOCK_SHIFT - RAYMARCH_BRICK_SHIFT);
constexpr size_t kEntriesMax = RAYMARCH_FULL;
constexpr size_t kBricksMax = kDrawnTableBytesMax / kDrawnBrickBytes;  // 107,374,182

size_t linear_index(const glm::ivec3& p, const glm::ivec3& dims) {
  return static_cast<size_t>(p.x) +
         static_cast<size_t>(dims.x) *
             (static_cast<size_t>(p.y) + static_cast<size_t>(dims.y) * static_cast<size_t>(p.z));
}

glm::ivec3 decoded(uint32_t morton) {
  const auto p = morton_decode(morton);
  return {p[0], p[1], p[2]};
}

bool is_empty(uint32_t entry) {
  return entry < RAYMARCH_FULL;
}

// Calls visit(p) for the cells of a box that starts at 0, x fastest.
template <typename Visit>
void for_each_cell(const glm::ivec3& dims, Visit&& visit) {
  glm::ivec3 p;
  for (p.z = 0; p.z < dims.z; ++p.z) {
    for (p.y = 0; p.y < dims.y; ++p.y) {
      for (p.x = 0; p.x < dims.x; ++p.x) visit(p);
    }
  }
}

// Writes into the empty entries of a table the size of the aligned empty cube around each. A cube
// of twice the side is empty if its eight halves are. Cells outside the table count as empty: only
// the grid's own table has sides that are no powers of two, and nothing follows it.
void mark_empty_cubes(std::span<uint32_t> table, const glm::ivec3& dims, uint32_t entry_shift) {
  for (uint32_t& entry : table) {
    if (is_empty(entry)) entry = entry_shift;
  }
  const int longest = std::max(dims.x, std::max(dims.y, dims.z));
  for (int half = 1; half < longest; half *= 2) {
    ++entry_shift;
    const glm::ivec3 cubes = (dims + (2 * half - 1)) / (2 * half);
    for_each_cell(cubes, [&](const glm::ivec3& cube) {
      const glm::ivec3 low = cube * (2 * half), size = glm::min(dims - low, glm::ivec3(2 * half));
      bool empty = true;
      // A half is empty if its first entry was raised to the half's size.
      for_each_cell((size + (half - 1)) / half, [&](const glm::ivec3& p) {
        empty = empty && table[linear_index(low + p * half, dims)] == entry_shift - 1;
      });
      if (!empty) return;
      for_each_cell(size,
                    [&](const glm::ivec3& p) { table[linear_index(low + p, dims)] = entry_shift; });
    });
  }
}

class Packer {
 public:
  Packer(const Grid& grid, PackedGrid& packed)
      : grid_(grid), ids_(coloring_ids(grid)), packed_(packed) {}

  Status run() {
    packed_.spec = grid_.spec;
    packed_.has_color = grid_.channels.color || ids_.has_value();
    packed_.has_normal = grid_.channels.normal;
    packed_.tile_dims = grid_.spec.tile_dims();
    packed_.occupied_min = glm::ivec3(std::numeric_limits<int>::max());
    packed_.occupied_max = glm::ivec3(std::numeric_limits<int>::min());
    packed_.nodes.resize(linear_index({0, 0, packed_.tile_dims.z}, packed_.tile_dims));
    VOXELD_TRY(reserve());
    for (const SparseTile& tile : grid_.tiles) {
      add_tile(tile);
      if (packed_.nodes.size() >= kEntriesMax) return too_large("tables", packed_.nodes.size());
    }
    if (has_full_ && grid_.channels.color && !packed_.colors.empty()) packed_.full_color = inner();
    mark_empty_cubes(std::span(packed_.nodes).first(tile_entries()), packed_.tile_dims,
                     RAYMARCH_TILE_SHIFT);
    if (packed_.occupied_min.x >= packed_.occupied_max.x) {
      packed_.occupied_min = glm::ivec3(0);
      packed_.occupied_max = grid_.spec.dims;
    }
    packed_.hull = hull_points(grid_);
    packed_.luminance = median_luminance(packed_.colors);
    return {};
  }

 private:
  static Error too_large(const std::string& what, uint64_t count) {
    return Error{ErrorCode::kGridTooLarge, "the grid has too many " + what + " to render",
                 "at most " + std::to_string(kBricksMax) +
                     " bricks, fewer than 2^30 table entries and 2^32 voxels",
                 std::to_string(count)};
  }

  static uint32_t packed_color(const std::array<uint8_t, 3>& rgb) {
    return rgb[0] | uint32_t{rgb[1]} << 8 | uint32_t{rgb[2]} << 16 | 0xff000000u;
  }

  // The colour of voxels that have none.
  std::array<uint8_t, 3> inner() {
    if (!packed_.full_color) packed_.full_color = mean_color(grid_);
    return *packed_.full_color;
  }

  size_t tile_entries() const {
    return linear_index({0, 0, packed_.tile_dims.z}, packed_.tile_dims);
  }

  Status reserve() {
    size_t bricks = 0, colors = 0, normals = 0;
    for (const SparseTile& tile : grid_.tiles) {
      bricks += tile.masks.size();
      colors += ids_ ? id_samples(tile, *ids_).size() : tile.color.size() / 4;
      normals += tile.normal.size() / 3;
    }
    if (bricks > kBricksMax) return too_large("bricks", bricks);
    if (std::max(colors, normals) > std::numeric_limits<uint32_t>::max()) {
      return too_large("voxels", std::max(colors, normals));
    }
    resize_in_pieces(packed_.bricks, bricks * RAYMARCH_BRICK_WORDS);
    if (packed_.has_color) resize_in_pieces(packed_.colors, colors);
    if (grid_.channels.normal) resize_in_pieces(packed_.normals, normals);
    return {};
  }

  void grow_box(const glm::ivec3& low, const glm::ivec3& high) {
    packed_.occupied_min = glm::min(packed_.occupied_min, low);
    packed_.occupied_max = glm::max(packed_.occupied_max, high);
  }

  // Grows the occupied box by the voxels of one brick. A brick inside the box costs nothing.
  void grow_box(const BrickMask& mask, const glm::ivec3& base) {
    if (glm::all(glm::greaterThanEqual(base, packed_.occupied_min)) &&
        glm::all(glm::lessThanEqual(base + limits::kBrickSide, packed_.occupied_max))) {
      return;
    }
    for (uint32_t word = 0; word < 8; ++word) {
      for (uint64_t bits = mask.words[word]; bits != 0; bits &= bits - 1) {
        const glm::ivec3 p =
            base + decoded(word * 64 + static_cast<uint32_t>(std::countr_zero(bits)));
        grow_box(p, p + 1);
      }
    }
  }

  void add_tile(const SparseTile& tile) {
    if (tile.empty()) return;
    tile_base_ = glm::ivec3(tile.coord[0], tile.coord[1], tile.coord[2]);
    VOXELD_CHECK(glm::all(glm::greaterThanEqual(tile_base_, glm::ivec3(0))) &&
                     glm::all(glm::lessThan(tile_base_, packed_.tile_dims)),
                 "a tile outside the grid");
    const size_t tile_entry = linear_index(tile_base_, packed_.tile_dims);
    tile_base_ *= limits::kTileSide;
    has_full_ = has_full_ || !tile.full.empty();
    if (!tile.full.empty() && tile.full.front().level == kTileLevels) {
      packed_.nodes[tile_entry] = RAYMARCH_FULL;
      grow_box(tile_base_, glm::min(tile_base_ + limits::kTileSide, grid_.spec.dims));
      return;
    }
    tile_table_ = packed_.nodes.size();
    add_nodes(RAYMARCH_TILE_ENTRIES);
    packed_.nodes[tile_entry] = RAYMARCH_CHILD | static_cast<uint32_t>(tile_table_);
    for (const FullNode& node : tile.full) add_full(node);
    copy_attributes(tile);
    for (size_t brick = 0; brick < tile.masks.size(); ++brick) {
      add_brick(tile.brick_morton[brick], tile.masks[brick]);
    }
    finish_tile();
  }

  void add_nodes(size_t count) {
    make_room_in_pieces(packed_.nodes, count);
    packed_.nodes.resize(packed_.nodes.size() + count);
  }

  // Offset of the block's entry in the tile's table.
  size_t block_entry(const glm::ivec3& brick) const {
    return tile_table_ + linear_index(brick / kBricksPerSide, glm::ivec3(kBlocksPerSide));
  }

  // The entry of a brick. Its block gets a table if it has none.
  uint32_t& brick_entry(const glm::ivec3& brick) {
    const size_t entry = block_entry(brick);
    if (packed_.nodes[entry] == 0) {
      packed_.nodes[entry] = RAYMARCH_CHILD | static_cast<uint32_t>(packed_.nodes.size());
      add_nodes(RAYMARCH_BLOCK_WORDS);
    }
    const size_t table = packed_.nodes[entry] & ~RAYMARCH_CHILD;
    return packed_.nodes[table + linear_index(brick % kBricksPerSide, glm::ivec3(kBricksPerSide))];
  }

  // Marks a full node, at the largest parts of the tree that it covers.
  void add_full(const FullNode& node) {
    const glm::ivec3 first = decoded(node.brick_morton);
    const int side = 1 << node.level;
    const glm::ivec3 low = tile_base_ + first * limits::kBrickSide;
    grow_box(low, low + side * limits::kBrickSide);
    if (side < kBricksPerSide) {
      for_each_cell(glm::ivec3(side),
                    [&](const glm::ivec3& p) { brick_entry(first + p) = RAYMARCH_FULL; });
      return;
    }
    for_each_cell(glm::ivec3(side / kBricksPerSide), [&](const glm::ivec3& p) {
      packed_.nodes[block_entry(first + p * kBricksPerSide)] = RAYMARCH_FULL;
    });
  }

  void copy_attributes(const SparseTile& tile) {
    const size_t first = packed_.attribute_count;
    if (grid_.channels.color) {
      VOXELD_CHECK(first + tile.color.size() / 4 <= packed_.colors.size(), "a colour per voxel");
      std::ranges::copy(tile.color, reinterpret_cast<uint8_t*>(packed_.colors.data() + first));
      color_inner(std::span(packed_.colors).subspan(first, tile.color.size() / 4));
    }
    if (ids_) {
      const std::vector<uint16_t>& ids = id_samples(tile, *ids_);
      VOXELD_CHECK(first + ids.size() <= packed_.colors.size(), "an id per voxel");
      for (size_t i = 0; i < ids.size(); ++i) {
        cancel_point_at(i);
        packed_.colors[first + i] = packed_color(id_color(ids[i]));
      }
    }
    if (!grid_.channels.normal) return;
    VOXELD_CHECK(first + tile.normal.size() / 3 <= packed_.normals.size(), "a normal per voxel");
    for (size_t i = 0; i + 3 <= tile.normal.size(); i += 3) {
      cancel_point_at(i / 3);
      packed_.normals[first + i / 3] =
          pack_normal(tile.normal[i], tile.normal[i + 1], tile.normal[i + 2]);
    }
  }

  // Gives voxels inside of solids, which have no colour, that of full nodes, with alpha 0: means
  // leave it out.
  void color_inner(std::span<uint32_t> colors) {
    if (std::ranges::find(colors, 0u) == colors.end()) return;
    std::ranges::replace(colors, 0u, packed_color(inner()) & 0x00ffffffu);
  }

  void add_brick(uint32_t brick_morton, const BrickMask& mask) {
    cancel_point();
    const glm::ivec3 brick = decoded(brick_morton);
    grow_box(mask, tile_base_ + brick * limits::kBrickSide);
    brick_entry(brick) = RAYMARCH_CHILD | static_cast<uint32_t>(bricks_done_);
    uint32_t* words = &packed_.bricks[bricks_done_ * RAYMARCH_BRICK_WORDS];
    ++bricks_done_;
    std::memcpy(words, mask.words.data(), sizeof mask.words);
    const size_t first = packed_.attribute_count;
    words[RAYMARCH_BRICK_FIRST] = static_cast<uint32_t>(first);
    size_t count = 0;
    for (uint32_t i = 0; i < 8; ++i) {
      count += static_cast<size_t>(std::popcount(mask.words[i]));
      if (mask.words[i] != 0) words[RAYMARCH_BRICK_NODES] |= 1u << i;
    }
    packed_.attribute_count += count;
    if (packed_.has_color) {
      words[RAYMARCH_BRICK_COLOR] = mean_color(std::span(packed_.colors).subspan(first, count));
    }
    if (grid_.channels.normal) {
      words[RAYMARCH_BRICK_NORMAL] = mean_normal(std::span(packed_.normals).subspan(first, count));
    }
  }

  void finish_tile() {
    const auto blocks = std::span(packed_.nodes).subspan(tile_table_, RAYMARCH_TILE_ENTRIES);
    for (const uint32_t entry : blocks) {
      if ((entry & RAYMARCH_CHILD) != 0) finish_block(entry & ~RAYMARCH_CHILD);
    }
    mark_empty_cubes(blocks, glm::ivec3(kBlocksPerSide), RAYMARCH_BLOCK_SHIFT);
  }

  void finish_block(size_t table) {
    const auto entries = std::span(packed_.nodes).subspan(table, RAYMARCH_BLOCK_ENTRIES);
    mark_empty_cubes(entries, glm::ivec3(kBricksPerSide), RAYMARCH_BRICK_SHIFT);
    if (!packed_.has_color && !packed_.has_normal) return;
    std::array<uint32_t, RAYMARCH_BLOCK_ENTRIES> colors{}, normals{};
    size_t count = 0;
    for (const uint32_t entry : entries) {
      if ((entry & RAYMARCH_CHILD) == 0) continue;
      const uint32_t* words =
          &packed_.bricks[size_t{entry & ~RAYMARCH_CHILD} * RAYMARCH_BRICK_WORDS];
      colors[count] = words[RAYMARCH_BRICK_COLOR];
      normals[count++] = words[RAYMARCH_BRICK_NORMAL];
    }
    packed_.nodes[table + RAYMARCH_BLOCK_COLOR] = mean_color(std::span(colors).first(count));
    packed_.nodes[table + RAYMARCH_BLOCK_NORMAL] = mean_normal(std::span(normals).first(count));
  }

  const Grid& grid_;
  const std::optional<Channel> ids_;  // the channel of ids that are drawn as colours
  PackedGrid& packed_;
  glm::ivec3 tile_base_{0};  // first cell of the current tile
  size_t tile_table_ = 0;    // offset of the tile's table
  size_t bricks_done_ = 0;
  bool has_full_ = false;
};

}  // namespace

Result<PackedGrid> pack_grid(const Grid& grid) {
  PackedGrid packed;
  VOXELD_TRY(Packer(grid, packed).run());
  VOXELD_CHECK(!packed.has_color || packed.colors.size() == packed.attribute_count,
               "a colour per voxel");
  VOXELD_CHECK(!grid.channels.normal || packed.normals.size() == packed.attribute_count,
               "a normal per voxel");
  return packed;
}

}  // namespace voxeld
