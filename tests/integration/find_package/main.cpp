// count_voxels URL MESH SIZE: voxelizes a mesh and prints "voxels NX NY NZ".
#include <voxeld/client.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>

int main(int argc, char** argv) {
  using namespace voxeld::client;
  if (argc != 4) return 2;
  try {
    Client client{std::string(argv[1])};
    Job job = client.start(Source::file(argv[2]), Options().size(std::atoi(argv[3])));
    while (!job.wait_for(std::chrono::seconds(1))) {
      std::fprintf(stderr, "%s\n", job.info().stage.c_str());
    }
    const Grid grid = job.grid();
    unsigned long long visited = 0;
    grid.for_each([&](const Voxel&) { ++visited; });
    const auto dims = grid.dims();
    std::printf("%llu %d %d %d\n", visited, dims[0], dims[1], dims[2]);
    return visited == grid.voxel_count() ? 0 : 1;
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 3;
  }
}
