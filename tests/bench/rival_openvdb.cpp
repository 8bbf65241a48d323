// OpenVDB (libopenvdb-dev): meshToVolume, all threads. The surface is an unsigned distance field in
// the narrowest band; solid is the mask of what a signed one has inside; a band is what
// meshToLevelSet makes.
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/LevelSetUtil.h>
#include <openvdb/tools/MeshToVolume.h>

#include "tests/bench/rival.h"

namespace voxeld::bench {
namespace {

constexpr float kNarrow = 1.0f, kBand = 3.0f;  // voxels

openvdb::FloatGrid::Ptr distance_field(const GridMesh& mesh, float outside, float inside,
                                       int flags) {
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
  return openvdb::tools::meshToVolume<openvdb::FloatGrid>(adapter, *transform, outside, inside,
                                                          flags);
}

openvdb::FloatGrid::Ptr surface_field(const GridMesh& mesh) {
  return distance_field(mesh, kNarrow, kNarrow, openvdb::tools::UNSIGNED_DISTANCE_FIELD);
}

uint64_t surface(const GridMesh& mesh) {
  return surface_field(mesh)->activeVoxelCount();
}

// The interior is marked in nodes, not cell by cell.
uint64_t solid(const GridMesh& mesh) {
  const auto field = distance_field(mesh, kNarrow, kNarrow, 0);
  return openvdb::tools::sdfInteriorMask(*field)->activeVoxelCount();
}

uint64_t band(const GridMesh& mesh) {
  return distance_field(mesh, kBand, kBand, 0)->activeVoxelCount();
}

// As OpenVDB writes by default: blosc where it is built with it, and inactive values left out.
void save(const GridMesh& mesh, const std::string& path) {
  openvdb::GridPtrVec grids{surface_field(mesh)};
  openvdb::io::File file(path);
  file.write(grids);
}

}  // namespace

Rival openvdb_rival() {
  return {.name = "openvdb", .surface = surface, .solid = solid, .band = band, .save = save};
}

}  // namespace voxeld::bench
