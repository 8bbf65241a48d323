#include "server/formats/bricks/voxel_bricks.h"

#include <bit>

#include "server/base/cancel_point.h"
#include "server/base/parallel.h"
#include "server/base/pieces.h"

namespace voxeld::mesh {
namespace {

constexpr uint8_t kHalfCovered = 128;  // of 255

constexpr Planes kNoCells{};
constexpr Planes kAllCells = [] {
  Planes planes{};
  planes.fill(~uint64_t{0});
  return planes;
}();

std::vector<std::array<int32_t, 3>> coords_of(const Grid& grid) {
  std::vector<std::array<int32_t, 3>> coords;
  for (const SparseTile& tile : grid.tiles) coords.push_back(tile.coord);
  return coords;
}

// The voxels of a mask for which is_inside(voxel) holds; voxels are numbered from `attribute`.
template <typename Test>
Planes planes_where(const BrickMask& mask, size_t attribute, Test&& is_inside) {
  BrickMask kept;
  for (size_t w = 0; w < mask.words.size(); ++w) {
    for (uint64_t bits = mask.words[w]; bits != 0; bits &= bits - 1) {
      if (is_inside(attribute++)) kept.words[w] |= bits & (~bits + 1);
    }
  }
  return planes_of(kept);
}

Planes inside_planes(const SparseTile& tile, const BrickMask& mask, size_t attribute,
                     Inside inside) {
  switch (inside) {
    case Inside::kOccupied:
      break;
    case Inside::kCovered:
      return planes_where(mask, attribute,
                          [&](size_t voxel) { return tile.coverage[voxel] >= kHalfCovered; });
    case Inside::kNegative:
    case Inside::kNegativeInBand:
      return planes_where(mask, attribute, [&](size_t voxel) { return tile.distance[voxel] < 0; });
  }
  return planes_of(mask);
}

}  // namespace

Planes planes_of(const BrickMask& mask) {
  // Byte j of the mask is the j-th cube of 2x2x2 cells in Morton order: its low half is the lower
  // plane. These are the places of a half's four cells.
  constexpr std::array<uint64_t, 16> kHalfMasks = [] {
    std::array<uint64_t, 16> half{};
    constexpr std::array<unsigned, 4> kBits = {0, 1, 8, 9};
    for (size_t i = 0; i < half.size(); ++i) {
      for (size_t bit = 0; bit < kBits.size(); ++bit) {
        if ((i >> bit & 1) != 0) half[i] |= uint64_t{1} << kBits[bit];
      }
    }
    return half;
  }();
  Planes planes{};
  for (uint32_t w = 0; w < mask.words.size(); ++w) {
    for (uint32_t byte = 0; byte < 8; ++byte) {
      const uint64_t cells = mask.words[w] >> (8 * byte) & 0xff;
      const auto [x, y, z] = morton_decode(8 * w + byte);
      const uint32_t shift = 16 * y + 2 * x;
      planes[size_t{2} * z] |= kHalfMasks[cells & 15] << shift;
      planes[size_t{2} * z + 1] |= kHalfMasks[cells >> 4] << shift;
    }
  }
  return planes;
}

VoxelBricks::VoxelBricks(const Grid& grid, Inside inside)
    : grid_(&grid), index_(coords_of(grid)), full_(grid.tiles.size()) {
  parallel_for(grid.tiles.size(), [&](size_t tile) {
    cancel_point();
    find_full_bricks(tile);
  });
  parallel_for(grid.tiles.size(), [&](size_t tile) { index_.rows(tile) = surface_rows(tile); });
  index_.number_bricks();
  resize_in_pieces(inside_, index_.size());
  resize_in_pieces(sources_, index_.size());
  if (inside == Inside::kNegativeInBand) resize_in_pieces(hiding_, index_.size());
  parallel_for(grid.tiles.size(), [&](size_t tile) {
    cancel_point();
    fill_tile(tile, inside);
  });
}

const Planes& VoxelBricks::hiding(size_t tile, int x, int y, int z) const {
  const BrickPlace place = index_.place(tile, x, y, z);
  const Planes& absent = hiding_.empty() ? kNoCells : kAllCells;
  if (place.tile == kNone) return absent;
  if (const uint32_t brick = index_.find(place); brick != kNone) {
    return hiding_.empty() ? inside_[brick] : hiding_[brick];
  }
  return is_full(place) ? kAllCells : absent;
}

Planes VoxelBricks::open_faces(uint32_t tile, const std::array<int, 3>& brick, uint32_t axis,
                               bool up) const {
  const auto& [x, y, z] = brick;
  std::array<int, 3> next = brick;
  next[axis] += up ? 1 : -1;
  const Planes& inside = inside_[index_.find(tile, x, y, z)];
  const Planes& hiding = this->hiding(tile, x, y, z);
  const Planes& beside = this->hiding(tile, next[0], next[1], next[2]);
  Planes faces{};
  for (size_t p = 0; p < faces.size(); ++p) {
    uint64_t hidden = 0;
    if (axis == 2) {
      const size_t last = faces.size() - 1;
      if (up) hidden = p < last ? hiding[p + 1] : beside[0];
      if (!up) hidden = p > 0 ? hiding[p - 1] : beside[last];
    } else if (axis == 1) {
      hidden = up ? hiding[p] >> 8 | beside[p] << 56 : hiding[p] << 8 | beside[p] >> 56;
    } else if (up) {
      hidden = (hiding[p] >> 1 & ~(kColumn << 7)) | (beside[p] & kColumn) << 7;
    } else {
      hidden = (hiding[p] << 1 & ~kColumn) | (beside[p] >> 7 & kColumn);
    }
    faces[p] = inside[p] & ~hidden;
  }
  return faces;
}

void VoxelBricks::find_full_bricks(size_t tile) {
  for (const FullNode& node : grid_->tiles[tile].full) {
    for (uint32_t i = 0; i < node.brick_count(); ++i) {
      const auto [x, y, z] = morton_decode(node.brick_morton + i);
      full_[tile][z * kTileBricks + y] |= uint32_t{1} << x;
    }
  }
}

// The row of full bricks at y, z; x says in which tile: this one, or the one before or behind it.
uint32_t VoxelBricks::full_row(size_t tile, int x, int y, int z) const {
  const BrickPlace place = index_.place(tile, x, y, z);
  return place.tile == kNone ? 0 : full_[place.tile][row_of(place.y, place.z)];
}

// Bricks of masks, and full ones beside bricks that are not full.
BrickRows VoxelBricks::surface_rows(size_t tile) const {
  BrickRows rows{};
  for (int z = 0; z < kTileBricks; ++z) {
    for (int y = 0; y < kTileBricks; ++y) {
      const uint32_t full = full_[tile][row_of(y, z)];
      if (full == 0) continue;
      uint32_t buried = full_row(tile, 0, y - 1, z) & full_row(tile, 0, y + 1, z) &
                        full_row(tile, 0, y, z - 1) & full_row(tile, 0, y, z + 1);
      buried &= full << 1 | full_row(tile, -1, y, z) >> (kTileBricks - 1);
      buried &= full >> 1 | full_row(tile, kTileBricks, y, z) << (kTileBricks - 1);
      rows[row_of(y, z)] = full & ~buried;
    }
  }
  for (const uint32_t morton : grid_->tiles[tile].brick_morton) {
    const auto [x, y, z] = morton_decode(morton);
    rows[z * kTileBricks + y] |= uint32_t{1} << x;
  }
  return rows;
}

void VoxelBricks::fill_tile(size_t tile, Inside inside) {
  for_each_brick_of(index_.tiles()[tile].rows, [&](int x, int y, int z) {
    const uint32_t brick = index_.find(tile, x, y, z);
    inside_[brick] = kAllCells;
    sources_[brick] = {kNone, kNoAttributes};
    if (!hiding_.empty()) hiding_[brick] = kAllCells;
  });
  const SparseTile& voxels = grid_->tiles[tile];
  size_t attribute = 0;
  for (uint32_t i = 0; i < voxels.masks.size(); ++i) {
    const auto [x, y, z] = morton_decode(voxels.brick_morton[i]);
    const uint32_t brick =
        index_.find(tile, static_cast<int>(x), static_cast<int>(y), static_cast<int>(z));
    inside_[brick] = inside_planes(voxels, voxels.masks[i], attribute, inside);
    sources_[brick] = {i, attribute};
    if (!hiding_.empty()) {
      const Planes occupied = planes_of(voxels.masks[i]);
      for (size_t p = 0; p < occupied.size(); ++p) {
        hiding_[brick][p] = inside_[brick][p] | ~occupied[p];
      }
    }
    for (const uint64_t word : voxels.masks[i].words) {
      attribute += static_cast<size_t>(std::popcount(word));
    }
  }
}

}  // namespace voxeld::mesh
