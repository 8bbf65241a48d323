// The decoder in C against the tiles that were written, and against Grid.
#include "client/include/voxeld/decode.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "client/include/voxeld/client.h"
#include "proto/container/grid_format.h"
#include "tests/unit/proto/tile_maker.h"

namespace voxeld::client {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr ChannelSet kAllChannels = {true, true, true, true, true, true};

struct Free {
  void operator()(voxeld_grid* grid) const { voxeld_grid_free(grid); }
};
using Decoded = std::unique_ptr<voxeld_grid, Free>;

// Three tiles with full nodes of many sizes, in Morton order.
std::vector<SparseTile> tiles_with_full_nodes(const ChannelSet& channels) {
  std::mt19937 random(7);
  std::vector<SparseTile> tiles;
  for (const std::array<int32_t, 3>& coord :
       {std::array{0, 0, 0}, std::array{1, 0, 0}, std::array{0, 1, 0}}) {
    tiles.push_back(test::tile_with_full_nodes(random, channels));
    tiles.back().coord = coord;
  }
  return tiles;
}

GridHeader header_of(const ChannelSet& channels) {
  GridHeader header;
  header.dims = {512, 512, 256};
  header.origin = {-1.5, 0.25, 1e6};
  header.voxel_size = {0.5, 0.125, 2};
  header.channels = channels;
  header.meta_json = R"({"source":"ä.ply"})";
  return header;
}

Decoded decoded(const std::vector<uint8_t>& bytes) {
  std::array<char, 200> error{};
  Decoded grid(voxeld_grid_decode(bytes.data(), bytes.size(), error.data(), error.size()));
  EXPECT_NE(grid, nullptr) << error.data();
  return grid;
}

std::vector<uint8_t> container_of(const ChannelSet& channels) {
  return encode_grid(header_of(channels), tiles_with_full_nodes(channels)).value();
}

voxeld_grid_info info_of(const Decoded& grid) {
  voxeld_grid_info info{};
  voxeld_grid_get_info(grid.get(), &info);
  return info;
}

TEST(Decode, info_holds_the_header_of_the_container) {
  const Decoded grid = decoded(container_of({.normal = true, .coverage = true}));
  const voxeld_grid_info info = info_of(grid);
  EXPECT_THAT(info.dims, ElementsAre(512, 512, 256));
  EXPECT_THAT(info.origin, ElementsAre(-1.5, 0.25, 1e6));
  EXPECT_THAT(info.voxel_size, ElementsAre(0.5, 0.125, 2));
  EXPECT_STREQ(info.meta_json, R"({"source":"ä.ply"})");
  EXPECT_EQ(info.channels, 1u << VOXELD_NORMAL | 1u << VOXELD_COVERAGE);
}

TEST(Decode, rows_are_those_of_every_voxel_in_morton_order) {
  const auto tiles = tiles_with_full_nodes(kAllChannels);
  const Decoded grid = decoded(container_of(kAllChannels));
  const size_t count = info_of(grid).voxel_count;
  std::vector<int32_t> coords(3 * count);
  std::vector<uint8_t> color(4 * count), coverage(count);
  std::vector<int8_t> normal(3 * count);
  std::vector<uint16_t> material(count), label(count);
  std::vector<float> distance(count);
  voxeld_grid_get_coords(grid.get(), coords.data());
  ASSERT_EQ(voxeld_grid_get_channel(grid.get(), VOXELD_COLOR, color.data()), 1);
  ASSERT_EQ(voxeld_grid_get_channel(grid.get(), VOXELD_NORMAL, normal.data()), 1);
  ASSERT_EQ(voxeld_grid_get_channel(grid.get(), VOXELD_MATERIAL, material.data()), 1);
  ASSERT_EQ(voxeld_grid_get_channel(grid.get(), VOXELD_LABEL, label.data()), 1);
  ASSERT_EQ(voxeld_grid_get_channel(grid.get(), VOXELD_DISTANCE, distance.data()), 1);
  ASSERT_EQ(voxeld_grid_get_channel(grid.get(), VOXELD_COVERAGE, coverage.data()), 1);

  int farthest = 1;
  for (const SparseTile& tile : tiles) {
    for (const int16_t steps : tile.distance) farthest = std::max(farthest, std::abs(steps));
  }
  size_t row = 0, inside = 0;
  for (const SparseTile& tile : tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      ASSERT_LT(row, count);
      const size_t i = row++;
      ASSERT_EQ((std::array{coords[3 * i], coords[3 * i + 1], coords[3 * i + 2]}),
                (std::array{x, y, z}));
      const bool has = voxel != kNoAttributes;
      inside += has ? 0 : 1;
      ASSERT_EQ(color[4 * i + 2], has ? tile.color[4 * voxel + 2] : 0);
      ASSERT_EQ(normal[3 * i + 1], has ? tile.normal[3 * voxel + 1] : 0);
      ASSERT_EQ(material[i], has ? tile.material[voxel] : 0);
      ASSERT_EQ(label[i], has ? tile.label[voxel] : 0);
      ASSERT_EQ(distance[i], static_cast<float>(has ? tile.distance[voxel] : -farthest) / 128);
      ASSERT_EQ(coverage[i], has ? tile.coverage[voxel] : 255);
    });
  }
  EXPECT_EQ(row, count);
  EXPECT_GT(inside, 0u);
  EXPECT_LT(inside, count);
}

TEST(Decode, distances_in_world_units_are_multiples_of_the_shortest_edge) {
  const ChannelSet channels = {.distance = true};
  GridHeader header = header_of(channels);
  const auto tiles = tiles_with_full_nodes(channels);
  const auto plain = encode_grid(header, tiles).value();
  header.meta_json = R"({"options":{"distance":"world"}})";
  const auto bytes = encode_grid(header, tiles).value();
  const size_t count = info_of(decoded(bytes)).voxel_count;
  std::vector<float> in_voxels(count), in_world(count);
  ASSERT_EQ(voxeld_grid_get_channel(decoded(plain).get(), VOXELD_DISTANCE, in_voxels.data()), 1);
  ASSERT_EQ(voxeld_grid_get_channel(decoded(bytes).get(), VOXELD_DISTANCE, in_world.data()), 1);
  for (size_t i = 0; i < count; ++i) ASSERT_EQ(in_world[i], in_voxels[i] * 0.125F);
  const Grid grid = Grid::decode(std::as_bytes(std::span(bytes)));
  const Grid other = Grid::decode(std::as_bytes(std::span(plain)));
  grid.for_each([&](const Voxel& voxel) {
    ASSERT_EQ(voxel.distance, other.voxel(voxel.x, voxel.y, voxel.z)->distance * 0.125F);
  });
}

TEST(Decode, marked_cells_are_those_of_grid) {
  const auto bytes = container_of({.color = true});
  std::vector<uint8_t> cells(size_t{512} * 512 * 256);
  voxeld_grid_mark_occupied(decoded(bytes).get(), cells.data());
  EXPECT_EQ(cells, Grid::decode(std::as_bytes(std::span(bytes))).dense());
}

TEST(Decode, channels_that_the_grid_lacks_are_left_alone) {
  const Decoded grid = decoded(container_of({.color = true}));
  uint8_t row = 7;
  for (const int channel : {-1, int{VOXELD_NORMAL}, int{VOXELD_COVERAGE}, 6}) {
    EXPECT_EQ(voxeld_grid_get_channel(grid.get(), channel, &row), 0);
  }
  EXPECT_EQ(row, 7);
}

TEST(Decode, broken_bytes_are_refused_with_the_reason_cut_to_the_buffer) {
  std::vector<uint8_t> bytes = container_of({.color = true});
  bytes.resize(bytes.size() - 1);
  std::array<char, 200> error{};
  EXPECT_EQ(voxeld_grid_decode(bytes.data(), bytes.size(), error.data(), error.size()), nullptr);
  EXPECT_THAT(error.data(), HasSubstr("grid container, byte "));
  std::array<char, 5> small{'x', 'x', 'x', 'x', 'x'};
  EXPECT_EQ(voxeld_grid_decode(bytes.data(), bytes.size(), small.data(), small.size()), nullptr);
  EXPECT_STREQ(small.data(), "grid");
  EXPECT_EQ(voxeld_grid_decode(nullptr, 0, nullptr, 0), nullptr);
  voxeld_grid_free(nullptr);
}

}  // namespace
}  // namespace voxeld::client
