// write_sample DIR: a container and, as text, what it holds, for the test of docs/read_grid.py.
#include <cstdio>
#include <fstream>
#include <set>
#include <string>

#include "server/formats/formats.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

bool write_container(const std::string& path, const Grid& grid) {
  const auto bytes = encode(grid, {});
  if (!bytes) {
    std::fprintf(stderr, "%s\n", bytes.error().message().c_str());
    return false;
  }
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes->data()),
             static_cast<std::streamsize>(bytes->size()));
  return file.good();
}

// One line per voxel: x y z, r g b a, nx ny nz.
bool write_text(const std::string& path, const std::vector<test::TestVoxel>& voxels) {
  std::ofstream file(path);
  for (const test::TestVoxel& voxel : voxels) {
    for (const int coordinate : voxel.cell) file << coordinate << ' ';
    for (const int channel : voxel.color) file << channel << ' ';
    for (const int component : voxel.normal) file << component << ' ';
    file << '\n';
  }
  return file.good();
}

// Voxels in different cells; dims that differ on each axis and end inside a tile.
bool write_all(const std::string& directory) {
  const std::array<int, 3> dims = {300, 530, 270};
  std::mt19937 random(20);
  std::vector<test::TestVoxel> voxels;
  std::set<std::array<int, 3>> taken;
  for (const test::TestVoxel& voxel : test::random_voxels(random, dims, 3000)) {
    if (taken.insert(voxel.cell).second) voxels.push_back(voxel);
  }
  return write_container(directory + "/all.voxg", test::grid_of(dims, voxels, true, true)) &&
         write_container(directory + "/bare.voxg", test::grid_of(dims, voxels, false, false)) &&
         write_container(directory + "/empty.voxg", test::grid_of(dims, {}, true, false)) &&
         write_text(directory + "/voxels.txt", voxels);
}

}  // namespace
}  // namespace voxeld

int main(int argc, char** argv) {
  return argc == 2 && voxeld::write_all(argv[1]) ? 0 : 1;
}
