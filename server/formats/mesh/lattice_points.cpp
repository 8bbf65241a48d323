#include "server/formats/mesh/lattice_points.h"

#include "server/base/parallel.h"
#include "server/base/pieces.h"

namespace voxeld::mesh {
namespace {

// Tiles with voxels, and those behind them on any axis, in which the last points of voxels may be.
std::vector<std::array<int32_t, 3>> point_coords(const BrickIndex& voxels) {
  std::vector<std::array<int32_t, 3>> coords;
  for (const BrickIndex::Tile& tile : voxels.tiles()) {
    // Whether bricks at the tile's end have points in the next one.
    std::array<bool, 3> ends{};
    for_each_brick_of(tile.rows, [&](int x, int y, int z) {
      ends[0] = ends[0] || x == kTileBricks - 1;
      ends[1] = ends[1] || y == kTileBricks - 1;
      ends[2] = ends[2] || z == kTileBricks - 1;
    });
    for (int32_t i = 0; i < 8; ++i) {
      const std::array<int32_t, 3> next = {i & 1, i >> 1 & 1, i >> 2};
      bool has_points = true;
      for (size_t c = 0; c < 3; ++c) has_points = has_points && (next[c] == 0 || ends[c]);
      if (!has_points) continue;
      coords.push_back({tile.coord[0] + next[0], tile.coord[1] + next[1], tile.coord[2] + next[2]});
    }
  }
  return coords;
}

// The bricks of voxels whose corners lie in the bricks of points at y and z of a tile: those at the
// same place, and before it on each axis.
uint32_t point_row(const BrickIndex& voxels, const std::array<uint32_t, 8>& tiles, int y, int z) {
  const auto row = [&](int before_x, int at_y, int at_z) {
    const int i = before_x + (at_y < 0 ? 2 : 0) + (at_z < 0 ? 4 : 0);
    const uint32_t tile = tiles[static_cast<size_t>(i)];
    if (tile == kNone) return uint32_t{0};
    return voxels.tiles()[tile].rows[row_of(at_y & (kTileBricks - 1), at_z & (kTileBricks - 1))];
  };
  uint32_t bits = 0;
  for (int dz = 0; dz < 2; ++dz) {
    for (int dy = 0; dy < 2; ++dy) {
      const uint32_t here = row(0, y - dy, z - dz);
      bits |= here | here << 1 | row(1, y - dy, z - dz) >> (kTileBricks - 1);
    }
  }
  return bits;
}

}  // namespace

LatticePoints::LatticePoints(const VoxelBricks& voxels) : index_(point_coords(voxels.index())) {
  const BrickIndex& of_voxels = voxels.index();
  parallel_for(index_.tiles().size(), [&](size_t i) {
    const auto coord = index_.tiles()[i].coord;
    std::array<uint32_t, 8> before{};  // tiles of voxels by x, y, z before this one
    for (int32_t t = 0; t < 8; ++t) {
      before[static_cast<size_t>(t)] =
          of_voxels.find_tile({coord[0] - (t & 1), coord[1] - (t >> 1 & 1), coord[2] - (t >> 2)});
    }
    for (int z = 0; z < kTileBricks; ++z) {
      for (int y = 0; y < kTileBricks; ++y) {
        index_.rows(i)[row_of(y, z)] = point_row(of_voxels, before, y, z);
      }
    }
  });
  index_.number_bricks();
  resize_in_pieces(marks_, index_.size());
  tile_of_.reserve(of_voxels.tiles().size());
  for (const BrickIndex::Tile& tile : of_voxels.tiles()) {
    tile_of_.push_back(index_.find_tile(tile.coord));
  }
}

}  // namespace voxeld::mesh
