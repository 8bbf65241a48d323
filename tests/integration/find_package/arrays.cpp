// save_arrays URL FILE: voxelizes a mesh in arrays, saves the grid in the format of the file's
// extension, and prints "voxels R G B", the colour of its first cell.
#include <voxeld/client.h>

#include <cstdio>

int main(int argc, char** argv) {
  using namespace voxeld::client;
  if (argc != 3) return 2;
  const std::vector<double> vertices = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  const std::vector<int> triangles = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
  const std::vector<float> colors = {1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0};  // all red
  try {
    Client client{std::string(argv[1])};
    const Grid grid = client.voxelize(Source::mesh(vertices, triangles, colors),
                                      Options().size(32).fill(Fill::kSolid).up(UpAxis::kY));
    grid.save(argv[2], Options().palette(16));
    const Color color = grid.color(0, 0, 0).value();
    std::printf("%llu %d %d %d\n", static_cast<unsigned long long>(grid.voxel_count()), color[0],
                color[1], color[2]);
    return 0;
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 3;
  }
}
