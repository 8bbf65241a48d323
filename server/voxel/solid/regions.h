// Regions of cells: those that rule=touch leaves empty, joined by face neighbours. No triangle lies
// between the centres of two neighbours, so that all cells of a region are on one side of the mesh
// unless it has holes wider than a cell.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/voxel/solid/distance/brick_planes.h"
#include "server/voxel/solid/inside/inside.h"
#include "server/voxel/solid/inside/tile_bits.h"

namespace voxeld {

// Extends `reached` to all cells of `free` that face neighbours in the brick join to it.
void spread(const BrickPlanes& free, BrickPlanes& reached);

// Floods regions brick by brick, and tiles without touched cells as a whole. Not thread-safe.
class Regions {
 public:
  // Cells of one region in a brick, or a tile that belongs to it as a whole.
  struct Piece {
    glm::ivec3 tile{0};
    int32_t brick = kWholeTile;  // Morton index in the tile
    BrickPlanes cells{};
  };
  static constexpr int32_t kWholeTile = -1;
  // A cell is visited once in each turn.
  enum class Turn : uint8_t { kFirst, kSecond };
  using Visit = std::function<void(const Piece&)>;

  // touched: the cells of rule=touch, in any order of tiles.
  Regions(std::span<const SparseTile> touched, const glm::ivec3& dims);

  // Visits all regions that reach the outside of the grid: the first turn of their cells. progress:
  // called from time to time, with 0 columns done.
  Status flood_outside(const ColumnProgress& progress);
  // A part of a region that has not had its first turn; nullopt if all have.
  std::optional<Piece> next();
  // Visits the region of `start`. Each of its cells is in one piece.
  Status flood(const Piece& start, Turn turn, const Visit& visit, const ColumnProgress& progress);

  // The cells of a brick that had their first turn, and those that are touched. A brick is given by
  // the number of its tile and its Morton index there.
  BrickPlanes reached(size_t tile, uint32_t brick) const;
  BrickPlanes touched(size_t tile, uint32_t brick) const;

  const glm::ivec3& tile_dims() const { return tile_dims_; }
  size_t tile_count() const { return tiles_.size(); }
  glm::ivec3 tile_at(size_t number) const;
  size_t tile_number(const glm::ivec3& tile) const {
    return (static_cast<size_t>(tile.z) * static_cast<size_t>(tile_dims_.y) +
            static_cast<size_t>(tile.y)) *
               static_cast<size_t>(tile_dims_.x) +
           static_cast<size_t>(tile.x);
  }
  bool is_divided(size_t tile) const { return tiles_[tile].places != nullptr; }

  // An upper bound of the bytes that it takes. surface_bytes: of the touched tiles.
  static int64_t bytes_for(const glm::ivec3& dims, int64_t surface_bytes);

 private:
  // A brick with touched cells. Bits outside the grid are free and connect to the outside.
  struct Mixed {
    BrickPlanes free{};
    std::array<BrickPlanes, 2> reached{};  // by turn
    BrickPlanes entered{};                 // cells to go on from, if it is queued
    bool is_queued = false;
  };
  // Without touched cells it is reached as a whole and has no places.
  struct Tile {
    uint8_t turns = 0;  // that it had
    // By brick: kFree less the turns that it had, or an index into mixed.
    std::unique_ptr<std::vector<int32_t>> places;
    std::vector<Mixed> mixed;
  };
  static constexpr int32_t kFree = -1;
  // A unit of work: one tile without places, or one brick.
  struct Item {
    glm::ivec3 tile;
    int32_t brick;
  };

  void add_tile(const SparseTile& from);
  Status run(const ColumnProgress& progress);
  void enter_from_outside();
  // Step into the tile or brick in `direction`; the former over its whole side.
  void enter_tile(const glm::ivec3& tile, size_t direction);
  void enter_brick(const glm::ivec3& brick, const BrickPlanes& entered);
  void reach_tile(const glm::ivec3& coord);
  void visit(const Item& item);

  glm::ivec3 tile_dims_, bricks_;
  std::vector<Tile> tiles_;
  std::vector<Item> queue_;
  uint8_t turn_ = 0;
  const Visit* visit_ = nullptr;
  size_t next_tile_ = 0;
  uint32_t next_brick_ = 0;
};

}  // namespace voxeld
