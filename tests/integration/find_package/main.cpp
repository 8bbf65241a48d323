// count_voxels URL MESH SIZE: voxelizes a mesh and prints "voxels NX NY NZ".
#include <voxeld/client.h>

#include <cstdio>

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  try {
    voxeld::client::Client client{std::string(argv[1])};
    voxeld::client::Options options;
    options.set("size", argv[3]);
    const voxeld::client::Grid grid =
        client.voxelize(voxeld::client::Source::file(argv[2]), options);
    unsigned long long visited = 0;
    grid.for_each([&](int, int, int, const voxeld::client::Color*, const voxeld::client::Normal*) {
      ++visited;
    });
    const auto dims = grid.dims();
    std::printf("%llu %d %d %d\n", visited, dims[0], dims[1], dims[2]);
    return visited == grid.voxel_count() ? 0 : 1;
  } catch (const voxeld::client::Error& error) {
    std::fprintf(stderr, "%s: %s\n", error.code().c_str(), error.what());
    return 3;
  }
}
