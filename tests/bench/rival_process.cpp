// A rival's whole process, to be timed from outside: MESH.ply SIZE OUT reads the mesh, voxelizes
// its surface and writes a file. Reading is voxeld's, so that what is compared is the rest. One
// rival per executable, so that none loads the libraries of another.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <utility>

#include "server/base/disk/file.h"
#include "server/scene/load.h"
#include "server/scene/ply/body.h"
#include "tests/bench/rival.h"

namespace voxeld::bench {
namespace {

// Not load_scene(): it would load, at the start of the process, the libraries of every format.
Result<Scene> triangles_of(const std::string& path) {
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(path));
  VOXELD_ASSIGN(const PlyHeader header, read_ply_header(path, file.bytes()));
  VOXELD_ASSIGN(PlyMesh mesh, read_ply_body(path, header, file.bytes()));
  if (std::ranges::any_of(mesh.face_sizes, [](uint32_t size) { return size != 3; })) {
    return Error{ErrorCode::kUnsupportedFeature, path, "triangles alone", "polygons"};
  }
  Scene scene;
  MeshPart& part = scene.parts.emplace_back();
  part.positions = std::move(mesh.positions);
  part.indices = std::move(mesh.corners);
  return scene;
}

Status run(char** argv) {
  VOXELD_ASSIGN(const Scene scene, triangles_of(argv[1]));
  VOXELD_BENCH_RIVAL().save(grid_mesh(scene, std::atoi(argv[2])), argv[3]);
  return {};
}

}  // namespace
}  // namespace voxeld::bench

int main(int argc, char** argv) try {
  if (argc != 4) {
    std::fprintf(stderr, "%s MESH.ply SIZE OUT\n", argv[0]);
    return 2;
  }
  const auto status = voxeld::bench::run(argv);
  if (!status) std::fprintf(stderr, "%s\n", status.error().message().c_str());
  return status ? 0 : 1;
} catch (const std::exception& e) {
  std::fprintf(stderr, "%s\n", e.what());
  return 1;
}
