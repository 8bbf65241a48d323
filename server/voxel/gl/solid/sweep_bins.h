// Binning for sweeps on a device: the triangles that can cross the columns of each tile, or slab of
// a tile. For the CPU, solid/triangle_columns.h bins by column alone.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "server/voxel/solid/inside/crossings.h"

namespace voxeld {

class SweepBins {
 public:
  // slab_cells: cells of a slab along the axis. It equals or divides limits::kTileSide.
  SweepBins(const FillMesh& mesh, int axis, const glm::ivec3& dims, int slab_cells);

  int axis() const { return axis_; }
  // Triangles whose first cells above a crossing may lie in the slab, ascending. The lowest slab
  // also has those below the grid. tile_u, tile_v: the column; slab: counted along the whole grid.
  std::span<const uint32_t> triangles(int tile_u, int tile_v, int slab) const {
    const size_t bin = bin_of(tile_u, tile_v, slab);
    return std::span(list_).subspan(first_[bin], first_[bin + 1] - first_[bin]);
  }
  int slabs() const { return slabs_; }

 private:
  size_t bin_of(int tile_u, int tile_v, int slab) const {
    const size_t column =
        static_cast<size_t>(tile_v) * static_cast<size_t>(tiles_u_) + static_cast<size_t>(tile_u);
    return column * static_cast<size_t>(slabs_) + static_cast<size_t>(slab);
  }

  int axis_, tiles_u_, slabs_;
  std::vector<uint32_t> list_;
  std::vector<size_t> first_;
};

}  // namespace voxeld
