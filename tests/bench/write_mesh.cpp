// One mesh for all programs that are compared: write_mesh MESH OUT.ply [--shuffle SEED] writes a
// binary PLY. MESH as in bench_scene.h.
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "tests/bench/bench_scene.h"

namespace {

voxeld::Status write(int argc, char** argv) {
  VOXELD_ASSIGN(voxeld::Scene scene, voxeld::bench::bench_scene(argv[1]));
  if (argc == 5 && std::strcmp(argv[3], "--shuffle") == 0) {
    voxeld::bench::shuffle_triangles(scene, static_cast<uint32_t>(std::atoi(argv[4])));
  }
  VOXELD_TRY(voxeld::bench::write_ply(scene, argv[2]));
  std::printf("%zu triangles\n", scene.triangle_count());
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3 && argc != 5) {
    std::fprintf(stderr, "write_mesh MESH OUT.ply [--shuffle SEED]; MESH: %s\n",
                 voxeld::bench::kSceneHelp);
    return 2;
  }
  const auto status = write(argc, argv);
  if (!status) std::fprintf(stderr, "%s\n", status.error().message().c_str());
  return status ? 0 : 1;
}
