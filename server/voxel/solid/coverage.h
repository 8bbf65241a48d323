// The channel coverage of fill=solid: the share of each voxel that is inside the mesh.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "proto/result.h"
#include "server/grid/grid_spec.h"
#include "server/voxel/solid/inside/inside.h"

namespace voxeld {

// Parts of a voxel along each axis.
inline constexpr int kCoverageParts = 4;

// Errors: grid-too-large if the parts would not fit a grid of cells.
Status check_coverage_dims(const glm::ivec3& dims);

// An upper estimate of the bytes that CoverageCounts takes, scratch memory included. surface_bytes:
// the surface's tiles without attributes.
int64_t coverage_bytes(const GridSpec& spec, int64_t surface_bytes, int threads);

// The number of parts, of 4x4x4 in each cell, whose centres are inside. The parts are the cells of
// a grid four times as fine, whose 64-bit words correspond to the cells of this grid.
class CoverageCounts {
 public:
  // Counts for all cells of a grid. The mesh is snapped to that grid and not again to the finer
  // one. sign: as in InsideJob. Errors: those of `progress`, which is called from time to time with
  // 0 columns done.
  static Result<CoverageCounts> of(const FillMesh& mesh, const glm::ivec3& dims, Sign sign,
                                   InsideFinder& finder, const ColumnProgress& progress);

  // Counts all parts of each cell that is not in `touched` (the cells of rule=touch) as the cell:
  // inside if it is in `inside`. Tiles are canonical, in any order.
  void settle_untouched(std::span<const SparseTile> touched, std::span<const SparseTile> inside);

  // Turns bricks of full nodes into masks if one of their cells is not entirely inside, because the
  // voxels of full nodes count as covered. The tiles must have no attributes.
  void spell_out(std::vector<SparseTile>& inside) const;

  // Sets SparseTile::coverage of all voxels of masks: 255 times the inside share, rounded.
  void write(std::vector<SparseTile>& tiles) const;

 private:
  static constexpr size_t kTileBricks = size_t{1} << (3 * kTileLevels);

  struct BrickCounts {
    uint32_t brick_morton = 0;
    std::array<uint8_t, 512> inside{};  // parts inside, 0 to 64, by cell in Morton order
  };
  struct TileCounts {
    std::bitset<kTileBricks> full;     // by Morton index; bit set: all cells are entirely inside
    std::vector<BrickCounts> partial;  // other bricks with any part inside, ascending
  };

  void add(const SparseTile& finer, std::vector<uint8_t>& counts);
  static TileCounts settled(const TileCounts* counts, const SparseTile* touched,
                            const SparseTile* inside);
  void sort();
  // Counts, 0 to 64, of a brick's cells; null for the two uniform kinds.
  static const BrickCounts* find(const TileCounts& tile, uint32_t brick_morton);
  static void spell_out(const TileCounts* counts, SparseTile& tile);
  static void write(const TileCounts* counts, SparseTile& tile);
  const TileCounts* find(const SparseTile& tile) const;

  std::map<std::array<int32_t, 3>, TileCounts> tiles_;  // by coord
};

}  // namespace voxeld
