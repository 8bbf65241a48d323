#include "server/formats/cells/hexahedra.h"

#include <atomic>
#include <string>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"

namespace voxeld::cells {
namespace {

constexpr uint32_t kBricksAround = 8;  // bricks of points that have corners of a brick of voxels

// Tiles with voxels, and those behind them on any axis, in which their last points may be.
std::vector<std::array<int32_t, 3>> node_tiles(const Grid& grid) {
  std::vector<std::array<int32_t, 3>> coords;
  for (const SparseTile& tile : grid.tiles) {
    for (int32_t i = 0; i < 8; ++i) {
      coords.push_back(
          {tile.coord[0] + (i & 1), tile.coord[1] + (i >> 1 & 1), tile.coord[2] + (i >> 2)});
    }
  }
  return coords;
}

// The place of a brick of points behind a brick of voxels.
mesh::BrickPlace place_behind(const mesh::BrickIndex& index, uint32_t tile, uint32_t morton,
                              uint32_t around) {
  const auto brick = morton_decode(morton);
  return index.place(tile, static_cast<int>(brick[0] + (around & 1)),
                     static_cast<int>(brick[1] + (around >> 1 & 1)),
                     static_cast<int>(brick[2] + (around >> 2)));
}

// The corners of cells of a plane, in the plane's own points and in those behind it, by bits 0 (x)
// and 1 (y).
std::array<uint64_t, 4> corners_of_plane(uint64_t cells) {
  const uint64_t x = cells | (cells << 1 & ~mesh::kColumn);
  const uint64_t behind_x = cells >> 7 & mesh::kColumn;
  return {x | x << 8, behind_x | behind_x << 8, x >> 56, behind_x >> 56};
}

void add_points(uint64_t& plane, uint64_t points) {
  if (points == 0) return;
  std::atomic_ref(plane).fetch_or(points, std::memory_order_relaxed);
}

}  // namespace

Hexahedra::Hexahedra(const VoxelPieces& voxels)
    : voxels_(&voxels), index_(node_tiles(voxels.grid())) {
  find_bricks();
  ThreadPool::shared().for_each(voxels.count(), [&](size_t piece) {
    cancel_point();  // on the calling thread
    voxels.for_each_brick(piece, [&](const SparseTile& tile, uint32_t morton, const BrickMask& mask,
                                     size_t) { mark_corners(tile, morton, mask); });
  });
  number_nodes();
}

void Hexahedra::find_bricks() {
  for (const SparseTile& tile : grid().tiles) {
    cancel_point();
    const uint32_t number = index_.find_tile(tile.coord);
    for_each_brick(tile, [&](uint32_t morton, const BrickMask&, size_t) {
      for (uint32_t around = 0; around < kBricksAround; ++around) {
        const mesh::BrickPlace place = place_behind(index_, number, morton, around);
        index_.rows(place.tile)[mesh::row_of(place.y, place.z)] |= uint32_t{1} << place.x;
      }
    });
  }
  index_.number_bricks();
  bricks_.resize(index_.size());
  for (const mesh::BrickIndex::Tile& tile : index_.tiles()) {
    uint32_t number = tile.first;
    mesh::for_each_brick_of(tile.rows, [&](int x, int y, int z) {
      bricks_[number++].first_cell = {tile.coord[0] * limits::kTileSide + x * limits::kBrickSide,
                                      tile.coord[1] * limits::kTileSide + y * limits::kBrickSide,
                                      tile.coord[2] * limits::kTileSide + z * limits::kBrickSide};
    });
  }
}

uint32_t Hexahedra::find(const SparseTile& tile, uint32_t morton, uint32_t around) const {
  return index_.find(place_behind(index_, index_.find_tile(tile.coord), morton, around));
}

void Hexahedra::mark_corners(const SparseTile& tile, uint32_t morton, const BrickMask& mask) {
  const mesh::Planes cells = mesh::planes_of(mask);
  for (uint32_t xy = 0; xy < 4; ++xy) {
    mesh::Planes& here = bricks_[find(tile, morton, xy)].nodes;
    mesh::Planes& behind = bricks_[find(tile, morton, xy | 4)].nodes;
    uint64_t below = 0;
    for (size_t z = 0; z < cells.size(); ++z) {
      const uint64_t corners = corners_of_plane(cells[z])[xy];
      add_points(here[z], corners | below);
      below = corners;
    }
    add_points(behind[0], below);
  }
}

void Hexahedra::number_nodes() {
  piece_bricks_ = {0};
  uint32_t piece_begin = 0;
  for (uint32_t b = 0; b < bricks_.size(); ++b) {
    bricks_[b].first_node = node_count_;
    for (const uint64_t plane : bricks_[b].nodes) {
      node_count_ += static_cast<uint32_t>(std::popcount(plane));
    }
    if (node_count_ - piece_begin < kPieceNodes) continue;
    piece_bricks_.push_back(b + 1);
    piece_begin = node_count_;
  }
  if (node_count_ > piece_begin) piece_bricks_.push_back(static_cast<uint32_t>(bricks_.size()));
}

void Hexahedra::fill_numbers(const SparseTile& tile, uint32_t morton, Numbers& numbers) const {
  constexpr uint64_t kFirstRow = 0xff;
  for (uint32_t around = 0; around < kBricksAround; ++around) {
    const bool behind_x = (around & 1) != 0, behind_y = (around & 2) != 0, behind_z = around >= 4;
    const Brick& brick = bricks_[find(tile, morton, around)];
    const uint64_t kept =
        (behind_x ? mesh::kColumn : ~uint64_t{0}) & (behind_y ? kFirstRow : ~uint64_t{0});
    uint32_t before = brick.first_node;
    const size_t planes = behind_z ? 1 : brick.nodes.size();
    for (size_t z = 0; z < planes; ++z) {
      const uint64_t plane = brick.nodes[z];
      for (uint64_t bits = plane & kept; bits != 0; bits &= bits - 1) {
        const auto at = static_cast<size_t>(std::countr_zero(bits));
        const size_t x = behind_x ? kSide - 1 : at % limits::kBrickSide;
        const size_t y = behind_y ? kSide - 1 : at / limits::kBrickSide;
        const uint64_t lower = (bits & (~bits + 1)) - 1;
        numbers[((behind_z ? kSide - 1 : z) * kSide + y) * kSide + x] =
            before + static_cast<uint32_t>(std::popcount(plane & lower));
      }
      before += static_cast<uint32_t>(std::popcount(plane));
    }
  }
}

Status check_hexahedra(uint64_t voxels, Format format) {
  if (voxels <= kHexahedraMax) return {};
  return Error{ErrorCode::kGridTooLarge,
               std::string(format_name(format)) + ": too many voxels for 32-bit numbers of nodes",
               "at most " + std::to_string(kHexahedraMax) + " voxels", std::to_string(voxels)};
}

}  // namespace voxeld::cells
