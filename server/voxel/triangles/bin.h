// Sorts snapped triangles into the tiles that their bounding boxes reach.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "server/base/raw_vector.h"
#include "server/voxel/triangles/snap.h"

namespace voxeld {

struct TileBin {
  glm::ivec3 coord{0};                  // in tiles
  std::span<const uint32_t> triangles;  // indices into SnappedMesh::triangles, ascending
};

// Triangles by tile. Move-only, because the bins point into it.
class TileBins {
 public:
  TileBins(const SnappedMesh& mesh, const glm::ivec3& tile_dims);
  TileBins(TileBins&&) = default;
  TileBins& operator=(TileBins&&) = default;

  // Tiles with at least one triangle, in Morton order of coord: the order of a grid's tiles.
  const std::vector<TileBin>& bins() const { return bins_; }

 private:
  RawVector<uint32_t> triangles_;
  std::vector<TileBin> bins_;
};

}  // namespace voxeld
