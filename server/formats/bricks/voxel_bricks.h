// The voxels of a grid as bricks of bits in linear order, for searches of their outer faces.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/formats/bricks/brick_index.h"
#include "server/grid/grid.h"

namespace voxeld::mesh {

// The cells, or lattice points, of a brick: bit 8 * y + x of plane z.
using Planes = std::array<uint64_t, limits::kBrickSide>;
inline constexpr uint64_t kColumn = 0x0101010101010101;  // those with x = 0 of a plane

// The cells that a mesh encloses. The others are outside.
enum class Inside {
  kOccupied,        // voxels
  kCovered,         // voxels that the solid covers by half or more
  kNegative,        // voxels of negative distance
  kNegativeInBand,  // the same; cells without voxel are on neither side
};

class VoxelBricks {
 public:
  // The voxels of a brick in the grid's own arrays.
  struct Source {
    uint32_t mask;     // kNone: the brick of a full node
    size_t attribute;  // of its first voxel, or kNoAttributes
  };

  explicit VoxelBricks(const Grid& grid, Inside inside = Inside::kOccupied);

  // Bricks that may have an outer face. Tile numbers are those of the grid.
  const BrickIndex& index() const { return index_; }
  const Planes& inside(uint32_t brick) const { return inside_[brick]; }
  const Source& source(uint32_t brick) const { return sources_[brick]; }
  // Cells that hide the face of a neighbour inside, of a brick counted from the tile's first one,
  // on each axis -1..32.
  const Planes& hiding(size_t tile, int x, int y, int z) const;
  // Whether a brick of a tile that there is belongs to a full node.
  bool is_full(const BrickPlace& place) const {
    return (full_[place.tile][row_of(place.y, place.z)] >> place.x & 1) != 0;
  }
  // The cells inside whose neighbour up or down an axis is outside, of a brick of index().
  Planes open_faces(uint32_t tile, const std::array<int, 3>& brick, uint32_t axis, bool up) const;
  const Grid& grid() const { return *grid_; }

 private:
  void find_full_bricks(size_t tile);
  BrickRows surface_rows(size_t tile) const;
  uint32_t full_row(size_t tile, int x, int y, int z) const;
  void fill_tile(size_t tile, Inside inside);

  const Grid* grid_;
  BrickIndex index_;
  std::vector<BrickRows> full_;  // by tile: bricks of full nodes
  std::vector<Planes> inside_;
  std::vector<Planes> hiding_;  // empty: as inside_
  std::vector<Source> sources_;
};

// The mask's voxels in linear order.
Planes planes_of(const BrickMask& mask);

}  // namespace voxeld::mesh
