// OpenVDB (libopenvdb-dev): meshToVolume, an unsigned distance field in the narrowest band, all
// threads.
#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>

#include "tests/bench/rival.h"

namespace voxeld::bench {
namespace {

uint64_t run(const GridMesh& mesh) {
  openvdb::initialize();
  std::vector<openvdb::Vec3s> points(mesh.positions.size() / 3);
  for (size_t i = 0; i < points.size(); ++i) {
    const float* p = &mesh.positions[3 * i];
    points[i] = {p[0] - 0.5f, p[1] - 0.5f, p[2] - 0.5f};
  }
  std::vector<openvdb::Vec3I> triangles(mesh.indices.size() / 3);
  for (size_t t = 0; t < triangles.size(); ++t) {
    const int* v = &mesh.indices[3 * t];
    triangles[t] = openvdb::Vec3I(static_cast<unsigned>(v[0]), static_cast<unsigned>(v[1]),
                                  static_cast<unsigned>(v[2]));
  }
  const openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3s, openvdb::Vec3I> adapter(
      points, triangles);
  const auto transform = openvdb::math::Transform::createLinearTransform(1.0);
  const auto grid = openvdb::tools::meshToVolume<openvdb::FloatGrid>(
      adapter, *transform, 1.0f, 1.0f, openvdb::tools::UNSIGNED_DISTANCE_FIELD);
  return grid->activeVoxelCount();
}

}  // namespace

Rival openvdb_rival() {
  return {"openvdb", run};
}

}  // namespace voxeld::bench
