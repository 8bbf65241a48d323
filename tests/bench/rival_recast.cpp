// Recast (librecast-dev): the solid heightfield that navigation meshes start from. Spans along y of
// the clipped triangles' extent, one thread; the fastest conservative voxelizer that Debian has. It
// fills nothing: "solid" is its word for what is occupied.
#include <fstream>
#include <memory>
#include <stdexcept>

#include <recastnavigation/Recast.h>

#include "tests/bench/rival.h"

namespace voxeld::bench {
namespace {

struct FreeField {
  void operator()(rcHeightfield* field) const { rcFreeHeightField(field); }
};
using Field = std::unique_ptr<rcHeightfield, FreeField>;

Field rasterize(const GridMesh& mesh) {
  rcContext context(false);
  Field field(rcAllocHeightfield());
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
  return field;
}

uint64_t surface(const GridMesh& mesh) {
  const Field field = rasterize(mesh);
  uint64_t cells = 0;
  for (int i = 0; i < field->width * field->height; ++i) {
    for (const rcSpan* span = field->spans[i]; span != nullptr; span = span->next) {
      cells += span->smax - span->smin;
    }
  }
  return cells;
}

// One bit per cell, columns of y in rows of x, layers of z.
void save(const GridMesh& mesh, const std::string& path) {
  const Field field = rasterize(mesh);
  const auto side = static_cast<size_t>(mesh.size);
  std::vector<uint8_t> bits((side * side * side + 7) / 8);
  for (size_t column = 0; column < side * side; ++column) {
    for (const rcSpan* span = field->spans[column]; span != nullptr; span = span->next) {
      for (size_t y = span->smin; y < span->smax && y < side; ++y) {
        const size_t cell = column * side + y;
        bits[cell / 8] = static_cast<uint8_t>(bits[cell / 8] | 1u << cell % 8);
      }
    }
  }
  std::ofstream out(path, std::ios::binary);
  out.write(reinterpret_cast<const char*>(bits.data()), static_cast<std::streamsize>(bits.size()));
  if (!out.flush()) throw std::runtime_error("cannot write " + path);
}

}  // namespace

Rival recast_rival() {
  return {.name = "recast", .surface = surface, .save = save};
}

}  // namespace voxeld::bench
