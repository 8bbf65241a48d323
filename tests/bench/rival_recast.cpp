// Recast (librecast-dev): the solid heightfield that navigation meshes start from. Spans along y of
// the clipped triangles' extent, one thread; the fastest conservative voxelizer that Debian has.
#include <stdexcept>

#include <recastnavigation/Recast.h>

#include "tests/bench/rival.h"

namespace voxeld::bench {
namespace {

uint64_t run(const GridMesh& mesh) {
  rcContext context(false);
  rcHeightfield* field = rcAllocHeightfield();
  const auto side = static_cast<float>(mesh.size);
  const float low[3] = {0, 0, 0}, high[3] = {side, side, side};
  const auto triangles = static_cast<int>(mesh.indices.size() / 3);
  const std::vector<unsigned char> areas(mesh.indices.size() / 3, RC_WALKABLE_AREA);
  if (!rcCreateHeightfield(&context, *field, mesh.size, mesh.size, low, high, 1.0f, 1.0f) ||
      !rcRasterizeTriangles(&context, mesh.positions.data(),
                            static_cast<int>(mesh.positions.size() / 3), mesh.indices.data(),
                            areas.data(), triangles, *field)) {
    throw std::runtime_error("recast failed");
  }
  uint64_t cells = 0;
  for (int i = 0; i < field->width * field->height; ++i) {
    for (const rcSpan* span = field->spans[i]; span != nullptr; span = span->next) {
      cells += span->smax - span->smin;
    }
  }
  rcFreeHeightField(field);
  return cells;
}

}  // namespace

Rival recast_rival() {
  return {"recast", run};
}

}  // namespace voxeld::bench
