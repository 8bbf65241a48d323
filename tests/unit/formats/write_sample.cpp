// write_sample DIR: a container and, as text, what it holds, for the test of docs/read_grid.py.
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <set>
#include <string>

#include "server/formats/formats.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

constexpr ChannelSet kAll = channels_of_bits(test::kChannelSets - 1);

bool write_container(const std::string& path, const Grid& grid, const OutputOptions& options = {}) {
  const auto bytes = encode(grid, options);
  if (!bytes) {
    std::fprintf(stderr, "%s\n", bytes.error().message().c_str());
    return false;
  }
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes->data()),
             static_cast<std::streamsize>(bytes->size()));
  return file.good();
}

// One line per voxel: x y z, r g b a, nx ny nz, material, label, distance, coverage.
bool write_text(const std::string& path, const std::vector<test::TestVoxel>& voxels) {
  std::ofstream file(path);
  for (const test::TestVoxel& voxel : voxels) {
    for (const int coordinate : voxel.cell) file << coordinate << ' ';
    for (const int channel : voxel.color) file << channel << ' ';
    for (const int component : voxel.normal) file << component << ' ';
    file << voxel.material << ' ' << voxel.label << ' ' << voxel.distance << ' '
         << int{voxel.coverage} << '\n';
  }
  return file.good();
}

// Full nodes beside voxels with attributes.
bool write_solid(const std::string& directory) {
  std::mt19937 random(3);
  Grid grid = test::grid_of({256, 256, 256}, {}, kAll);
  grid.tiles = {test::tile_with_full_nodes(random, kAll)};
  std::erase_if(grid.tiles[0].full, [](const FullNode& node) { return node.level > 2; });
  std::vector<test::TestVoxel> voxels;
  const SparseTile& tile = grid.tiles[0];
  for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
    test::TestVoxel& one = voxels.emplace_back();
    one.cell = {x, y, z};
    one.coverage = 255;  // of voxels inside
    if (voxel == kNoAttributes) return;
    std::copy_n(&tile.color[4 * voxel], 4, one.color.begin());
    std::copy_n(&tile.normal[3 * voxel], 3, one.normal.begin());
    one.material = tile.material[voxel];
    one.label = tile.label[voxel];
    one.distance = tile.distance[voxel];
    one.coverage = tile.coverage[voxel];
  });
  return !tile.full.empty() && !tile.masks.empty() &&
         write_container(directory + "/solid.voxg", grid) &&
         write_text(directory + "/solid.txt", voxels);
}

constexpr OutputOptions kSmall = [] {
  OutputOptions options;
  options.codec = Codec::kSmall;
  return options;
}();

// Few voxels, for a slow reader, of smooth and of random attributes, and full nodes of three sizes.
bool write_small(const std::string& directory) {
  std::mt19937 random(8);
  auto voxels = test::random_voxels(random, {256, 256, 256}, 800);
  for (int i = 0; i < 900; ++i) {
    const int x = 30 + i % 30, y = 40 + i / 30;
    voxels.push_back({{x, y, 100 + x * y / 200},
                      {static_cast<uint8_t>(3 * x), static_cast<uint8_t>(5 * y), uint8_t(x + y),
                       static_cast<uint8_t>(i < 500 ? 255 : 100)},
                      {static_cast<int8_t>(x), static_cast<int8_t>(-y), int8_t{99}},
                      static_cast<uint16_t>(x < 44 ? 3 : 65535),
                      static_cast<uint16_t>(1 + y / 20),
                      static_cast<int16_t>(x * y - 1000),
                      static_cast<uint8_t>(4 * x)});
  }
  Grid grid = test::grid_of({256, 256, 256}, voxels, kAll);
  SparseTile& tile = grid.tiles[0];
  for (const FullNode& node : {FullNode{64, 0}, FullNode{4096, 3}, FullNode{7 << 12, 2}}) {
    const uint32_t end = node.brick_morton + node.brick_count();
    const auto next = std::ranges::lower_bound(tile.brick_morton, node.brick_morton);
    if (next == tile.brick_morton.end() || *next >= end) tile.full.push_back(node);
  }
  return tile.full.size() > 1 && write_container(directory + "/small.voxg", grid, kSmall) &&
         write_container(directory + "/small_as_fast.voxg", grid);
}

// A block of bricks over the middle of the tile that all have a hole: above 262144 voxels, so its
// octree is cut into octants.
bool write_split(const std::string& directory) {
  Grid grid = test::grid_of({256, 256, 256}, {}, ChannelSet());
  SparseTile& tile = grid.tiles.emplace_back();
  for (uint32_t morton = 0; morton < 32768; ++morton) {
    const auto [x, y, z] = morton_decode(morton);
    if (x < 12 || x > 20 || y < 12 || y > 20 || z < 13 || z > 20) continue;
    tile.brick_morton.push_back(morton);
    tile.masks.emplace_back().words.fill(~uint64_t{0});
    tile.masks.back().words[morton % 8] ^= uint64_t{1} << (morton % 61);
  }
  return write_container(directory + "/split.voxg", grid, kSmall) &&
         write_container(directory + "/split_as_fast.voxg", grid);
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
  return write_container(directory + "/all.voxg", test::grid_of(dims, voxels, kAll)) &&
         write_container(directory + "/bare.voxg", test::grid_of(dims, voxels, ChannelSet())) &&
         write_container(directory + "/empty.voxg",
                         test::grid_of(dims, {}, ChannelSet{.color = true})) &&
         write_text(directory + "/voxels.txt", voxels);
}

}  // namespace
}  // namespace voxeld

int main(int argc, char** argv) {
  return argc == 2 && voxeld::write_all(argv[1]) && voxeld::write_solid(argv[1]) &&
                 voxeld::write_small(argv[1]) && voxeld::write_split(argv[1])
             ? 0
             : 1;
}
