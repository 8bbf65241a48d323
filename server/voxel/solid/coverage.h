// Channel coverage of fill=solid: how much of each voxel is inside of the mesh.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <map>
#include <vector>

#include "proto/result.h"
#include "server/grid/grid_spec.h"
#include "server/voxel/solid/inside.h"

namespace voxeld {

// Parts of a voxel on each axis.
inline constexpr int kCoverageParts = 4;

// Errors: grid-too-large where the parts would not be cells of a grid.
Status check_coverage_dims(const glm::ivec3& dims);

// An upper estimate of what CoverageCounts keeps and needs while it is made, from the bytes of the
// surface's tiles without attributes.
int64_t coverage_bytes(const GridSpec& spec, int64_t surface_bytes, int threads);

// Of 4x4x4 parts of each cell, how many have their centres inside: those are the cells of a grid
// four times as fine, whose words of 64 bits are the cells of this one.
class CoverageCounts {
 public:
  // Of all cells of a grid; the mesh is snapped to that grid, not again to the finer one. `sign`:
  // as InsideJob. Errors: those of `progress`, which is called from time to time with 0 columns
  // done.
  static Result<CoverageCounts> of(const FillMesh& mesh, const glm::ivec3& dims, Sign sign,
                                   WorkerPool& pool, const ColumnProgress& progress);

  // Turns bricks of full nodes into masks where they have a cell that is not entirely inside: the
  // voxels of full nodes are taken for covered. The tiles have no attributes.
  void spell_out(std::vector<SparseTile>& inside) const;

  // Sets SparseTile::coverage of all voxels of masks: 255 times the part that is inside, rounded.
  void write(std::vector<SparseTile>& tiles) const;

 private:
  static constexpr size_t kTileBricks = size_t{1} << (3 * kTileLevels);

  struct BrickCounts {
    uint32_t brick_morton = 0;
    std::array<uint8_t, 512> inside{};  // of 64, by cell in Morton order
  };
  struct TileCounts {
    std::bitset<kTileBricks> full;     // by Morton order: all cells entirely inside
    std::vector<BrickCounts> partial;  // others with some, ascending
  };

  void add(const SparseTile& finer, std::vector<uint8_t>& counts);
  void sort();
  // 0 to 64 of a brick's cells; null for the two uniform kinds.
  static const BrickCounts* find(const TileCounts& tile, uint32_t brick_morton);
  static void spell_out(const TileCounts* counts, SparseTile& tile);
  static void write(const TileCounts* counts, SparseTile& tile);
  const TileCounts* find(const SparseTile& tile) const;

  std::map<std::array<int32_t, 3>, TileCounts> tiles_;  // by coord
};

}  // namespace voxeld
