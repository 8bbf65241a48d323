// voxeld_oracle MESH SIZE [touch|thin|center]: the number of occupied cells and the SHA-256 of the
// occupancy (uint8, z,y,x order, as in the data of a .npy) that the rule must give. The mesh comes
// through the daemon's loaders and placement; snapping and overlap are the oracle's own.
#include <cstdio>
#include <cstdlib>
#include <string>

#include "server/base/disk/file.h"
#include "server/base/sha256.h"
#include "server/grid/grid_spec.h"
#include "server/scene/load.h"
#include "tests/reference/line_oracle.h"
#include "tests/reference/touch_oracle.h"

namespace {

using CellsByRule = voxeld::reference::Occupancy (*)(
    const std::vector<voxeld::reference::Triangle>&, const voxeld::reference::OracleGrid&);

int run(const std::string& path, int size, CellsByRule cells_by_rule) {
  const auto file = voxeld::MappedFile::open(path);
  if (!file) return std::fprintf(stderr, "%s\n", file.error().message().c_str()), 1;
  const auto scene = voxeld::load_scene(path, file->bytes(), {.decode_images = false});
  if (!scene) return std::fprintf(stderr, "%s\n", scene.error().message().c_str()), 1;
  const voxeld::Box3d box = scene->bounds();
  voxeld::PlacementOptions placement;
  placement.size = size;
  const auto spec = voxeld::place_grid(placement, box.min, box.max);
  if (!spec) return std::fprintf(stderr, "%s\n", spec.error().message().c_str()), 1;

  std::vector<voxeld::reference::Triangle> triangles;
  for (const auto& part : scene->parts) {
    for (size_t i = 0; i + 2 < part.indices.size(); i += 3) {
      voxeld::reference::Triangle triangle;
      for (int k = 0; k < 3; ++k) {
        const glm::dvec3& p = part.positions[part.indices[i + static_cast<size_t>(k)]];
        triangle[static_cast<size_t>(k)] = {p.x, p.y, p.z};
      }
      triangles.push_back(triangle);
    }
  }
  const voxeld::reference::OracleGrid grid = {
      {spec->dims.x, spec->dims.y, spec->dims.z},
      {spec->origin_world.x, spec->origin_world.y, spec->origin_world.z},
      {spec->voxel_size.x, spec->voxel_size.y, spec->voxel_size.z}};
  const auto cells = cells_by_rule(triangles, grid);
  std::printf("dims %d %d %d occupied %zu %s\n", grid.dims[0], grid.dims[1], grid.dims[2],
              voxeld::reference::count(cells), voxeld::sha256_id(cells).c_str());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string rule = argc == 4 ? argv[3] : "touch";
  const CellsByRule cells_by_rule = rule == "touch"    ? voxeld::reference::touched_cells
                                    : rule == "thin"   ? voxeld::reference::thin_cells
                                    : rule == "center" ? voxeld::reference::center_cells
                                                       : nullptr;
  if ((argc != 3 && argc != 4) || cells_by_rule == nullptr) {
    std::fprintf(stderr, "usage: voxeld_oracle MESH SIZE [touch|thin|center]\n");
    return 2;
  }
  return run(argv[1], std::atoi(argv[2]), cells_by_rule);
}
