// The decoded grid against what was written into its container.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <memory>
#include <random>
#include <set>

#include "client/include/voxeld/client.h"
#include "proto/container/grid_format.h"
#include "tests/unit/client/client_test_tools.h"
#include "tests/unit/proto/tile_maker.h"

namespace voxeld::client {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

struct Written {
  std::map<std::array<int, 3>, test::TestVoxel> voxels;  // by cell
  std::vector<std::byte> container;
};

GridHeader header_of(const std::array<int, 3>& dims, bool has_color, bool has_normal) {
  GridHeader header;
  header.dims = dims;
  header.origin = {-1.5, 0.25, 1e6};
  header.voxel_size = {0.5, 0.125, 2};
  header.channels.color = has_color;
  header.channels.normal = has_normal;
  header.meta_json = R"({"source":"a.ply"})";
  return header;
}

Written written(const GridHeader& header, const std::vector<test::TestVoxel>& voxels) {
  Written out;
  for (const test::TestVoxel& voxel : voxels) out.voxels.try_emplace(voxel.cell, voxel);
  const auto tiles = test::tiles_of(voxels, header.channels);
  const auto bytes = encode_grid(header, tiles);
  EXPECT_TRUE(bytes.ok()) << bytes.error().message();
  const auto view = std::as_bytes(std::span(bytes.value()));
  out.container.assign(view.begin(), view.end());
  return out;
}

// Voxels over several tiles, with a row at the far end of every axis.
std::vector<test::TestVoxel> scattered(const std::array<int, 3>& dims, unsigned seed) {
  std::mt19937 random(seed);
  auto voxels = test::random_voxels(random, dims, 4000);
  for (const test::TestVoxel& corner :
       test::box_voxels({dims[0] - 2, dims[1] - 2, dims[2] - 2}, dims)) {
    voxels.push_back(corner);
  }
  return voxels;
}

TEST(Grid, holds_the_header_of_the_container) {
  const GridHeader header = header_of({300, 17, 5}, true, false);
  const Grid grid = Grid::decode(written(header, test::box_voxels({0, 0, 0}, {2, 2, 2})).container);
  EXPECT_THAT(grid.dims(), ElementsAre(300, 17, 5));
  EXPECT_THAT(grid.origin(), ElementsAre(-1.5, 0.25, 1e6));
  EXPECT_THAT(grid.voxel_size(), ElementsAre(0.5, 0.125, 2));
  EXPECT_EQ(grid.voxel_count(), 8u);
  EXPECT_TRUE(grid.has_color());
  EXPECT_FALSE(grid.has_normal());
  EXPECT_EQ(grid.meta_json(), R"({"source":"a.ply"})");
}

TEST(Grid, for_each_visits_every_voxel_once_with_its_color_and_normal) {
  const Written in = written(header_of({300, 40, 520}, true, true), scattered({300, 40, 520}, 1));
  const Grid grid = Grid::decode(in.container);
  std::set<std::array<int, 3>> seen;
  grid.for_each([&](int x, int y, int z, const Color* color, const Normal* normal) {
    const auto it = in.voxels.find({x, y, z});
    ASSERT_NE(it, in.voxels.end());
    ASSERT_NE(color, nullptr);
    ASSERT_NE(normal, nullptr);
    EXPECT_EQ(*color, it->second.color);
    EXPECT_EQ(*normal, it->second.normal);
    EXPECT_TRUE(seen.insert({x, y, z}).second);
  });
  EXPECT_EQ(seen.size(), in.voxels.size());
  EXPECT_EQ(grid.voxel_count(), in.voxels.size());
}

TEST(Grid, every_voxel_has_the_values_of_its_channels) {
  std::mt19937 random(6);
  const auto voxels = test::random_voxels(random, {300, 40, 52}, 3000);
  GridHeader header = header_of({300, 40, 52}, true, true);
  for (const uint32_t bits : {0u, 1u, 0b010100u, 0b101010u, 0b111111u}) {
    header.channels = channels_of_bits(bits);
    const Written in = written(header, voxels);
    const Grid grid = Grid::decode(in.container);
    EXPECT_EQ(grid.channels().size(), header.channels.count());
    size_t seen = 0;
    grid.for_each([&](const Voxel& voxel) {
      const test::TestVoxel& expected = in.voxels.at({voxel.x, voxel.y, voxel.z});
      const ChannelSet& has = header.channels;
      EXPECT_EQ(voxel.has_attributes, has.any());
      EXPECT_EQ(voxel.color, has.color ? expected.color : Color());
      EXPECT_EQ(voxel.normal, has.normal ? expected.normal : Normal());
      EXPECT_EQ(voxel.material, has.material ? expected.material : 0);
      EXPECT_EQ(voxel.label, has.label ? expected.label : 0);
      EXPECT_EQ(voxel.distance, has.distance ? static_cast<float>(expected.distance) / 128 : 0);
      EXPECT_EQ(voxel.coverage, has.coverage ? expected.coverage : 0);
      ++seen;
    });
    EXPECT_EQ(seen, in.voxels.size());
    const auto& [cell, expected] = *in.voxels.begin();
    const auto one = grid.voxel(cell[0], cell[1], cell[2]);
    ASSERT_TRUE(one.has_value());
    EXPECT_EQ(one->label, header.channels.label ? expected.label : 0);
  }
  EXPECT_FALSE(Grid::decode(written(header, {}).container).voxel(1, 1, 1).has_value());
}

TEST(Grid, voxels_of_full_nodes_are_occupied_and_have_no_color) {
  GridHeader header = header_of({256, 256, 256}, true, true);
  std::mt19937 random(5);
  const SparseTile tile = test::tile_with_full_nodes(random, true, true);
  ASSERT_FALSE(tile.full.empty());
  for (const auto codec : {voxeld::Codec::kFast, voxeld::Codec::kSmall}) {
    header.codecs.octree = codec;
    const auto bytes = encode_grid(header, std::span(&tile, 1));
    ASSERT_TRUE(bytes.ok());
    const Grid grid = Grid::decode(std::as_bytes(std::span(*bytes)));
    EXPECT_EQ(grid.voxel_count(), tile.voxel_count());
    std::vector<uint8_t> dense(size_t{1} << 24);
    size_t next = 0;
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      dense[static_cast<size_t>(x + 256 * (y + 256 * z))] = 1;
      if (next++ % 97 != 0) return;
      EXPECT_TRUE(grid.occupied(x, y, z));
      const auto color = grid.color(x, y, z);
      ASSERT_EQ(color.has_value(), voxel != kNoAttributes);
      EXPECT_TRUE(!color || (*color)[0] == tile.color[4 * voxel]);
    });
    EXPECT_TRUE(grid.dense() == dense);
    size_t visited = 0, colored = 0;
    grid.for_each([&](int, int, int, const Color* color, const Normal* normal) {
      ++visited;
      colored += color != nullptr ? 1 : 0;
      EXPECT_EQ(color == nullptr, normal == nullptr);
    });
    EXPECT_EQ(visited, tile.voxel_count());
    EXPECT_EQ(colored, tile.attribute_count());
  }
}

TEST(Grid, for_each_goes_in_morton_order_within_a_tile) {
  const Grid grid = Grid::decode(
      written(header_of({64, 64, 64}, false, false), scattered({64, 64, 64}, 2)).container);
  int64_t last = -1;
  grid.for_each([&](int x, int y, int z, const Color* color, const Normal* normal) {
    EXPECT_EQ(color, nullptr);
    EXPECT_EQ(normal, nullptr);
    const int64_t code =
        morton_encode(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z));
    EXPECT_GT(code, last);
    last = code;
  });
  EXPECT_GE(last, 0) << "no voxels";
}

TEST(Grid, occupied_and_color_return_every_cell_as_written) {
  const std::array<int, 3> dims = {270, 21, 33};
  const Written in = written(header_of(dims, true, false), scattered(dims, 3));
  const Grid grid = Grid::decode(in.container);
  for (int z = 0; z < dims[2]; ++z) {
    for (int y = 0; y < dims[1]; ++y) {
      for (int x = 0; x < dims[0]; ++x) {
        const auto it = in.voxels.find({x, y, z});
        ASSERT_EQ(grid.occupied(x, y, z), it != in.voxels.end()) << x << ' ' << y << ' ' << z;
        ASSERT_EQ(grid.color(x, y, z),
                  it == in.voxels.end() ? std::nullopt : std::optional<Color>(it->second.color));
      }
    }
  }
}

TEST(Grid, cells_outside_are_empty) {
  const std::array<int, 3> dims = {10, 10, 10};
  const Grid grid = Grid::decode(
      written(header_of(dims, true, true), test::box_voxels({0, 0, 0}, dims)).container);
  EXPECT_TRUE(grid.occupied(9, 9, 9));
  constexpr int kMin = std::numeric_limits<int>::min(), kMax = std::numeric_limits<int>::max();
  for (const int outside : {-1, 10, 256, 2048, kMin, kMax}) {
    EXPECT_FALSE(grid.occupied(outside, 0, 0));
    EXPECT_FALSE(grid.occupied(0, outside, 0));
    EXPECT_FALSE(grid.occupied(0, 0, outside));
    EXPECT_EQ(grid.color(outside, outside, outside), std::nullopt);
  }
}

TEST(Grid, without_colors_an_occupied_cell_has_none) {
  const Grid grid = Grid::decode(
      written(header_of({4, 4, 4}, false, true), test::box_voxels({0, 0, 0}, {1, 1, 1})).container);
  EXPECT_TRUE(grid.occupied(0, 0, 0));
  EXPECT_EQ(grid.color(0, 0, 0), std::nullopt);
}

TEST(Grid, dense_has_one_byte_per_cell_with_x_fastest) {
  const std::array<int, 3> dims = {270, 7, 9};
  const Written in = written(header_of(dims, false, false), scattered(dims, 4));
  const Grid grid = Grid::decode(in.container);
  const std::vector<std::uint8_t> dense = grid.dense();
  ASSERT_EQ(dense.size(), 270u * 7 * 9);
  size_t at = 0;
  for (int z = 0; z < dims[2]; ++z) {
    for (int y = 0; y < dims[1]; ++y) {
      for (int x = 0; x < dims[0]; ++x) {
        ASSERT_EQ(dense[at++], in.voxels.contains({x, y, z}) ? 1 : 0);
      }
    }
  }
}

TEST(Grid, an_empty_grid_has_dims_and_nothing_in_them) {
  const Grid grid = Grid::decode(written(header_of({3, 2, 1}, true, true), {}).container);
  EXPECT_EQ(grid.voxel_count(), 0u);
  EXPECT_THAT(grid.dense(), ElementsAre(0, 0, 0, 0, 0, 0));
  grid.for_each([](int, int, int, const Color*, const Normal*) { FAIL(); });
}

TEST(Grid, can_be_moved) {
  Grid first = Grid::decode(
      written(header_of({4, 4, 4}, false, false), test::box_voxels({0, 0, 0}, {2, 1, 1}))
          .container);
  Grid second = Grid::decode(written(header_of({9, 9, 9}, false, false), {}).container);
  second = std::move(first);
  EXPECT_EQ(second.voxel_count(), 2u);
}

TEST(Grid, the_container_may_go_after_decode) {
  auto in = std::make_unique<Written>(
      written(header_of({4, 4, 4}, true, false), test::box_voxels({0, 0, 0}, {2, 1, 1})));
  const Grid grid = Grid::decode(in->container);
  in.reset();
  EXPECT_EQ(grid.color(1, 0, 0), (Color{1, 0, 0, 255}));
}

TEST(Grid, every_truncated_container_is_a_bad_response) {
  const auto container =
      written(header_of({300, 40, 20}, true, true), test::box_voxels({250, 0, 0}, {260, 3, 3}))
          .container;
  for (size_t bytes = 0; bytes < container.size(); ++bytes) {
    const Error error = error_of([&] { Grid::decode(std::span(container).first(bytes)); });
    ASSERT_EQ(error.code(), "bad-response") << bytes;
    ASSERT_THAT(error.what(), HasSubstr("grid container, byte")) << bytes;
  }
  auto longer = container;
  longer.push_back(std::byte{0});
  EXPECT_EQ(error_of([&] { Grid::decode(longer); }).code(), "bad-response");
}

TEST(Grid, a_container_with_a_flipped_bit_decodes_or_is_a_bad_response) {
  const auto container =
      written(header_of({300, 40, 20}, true, true), test::box_voxels({250, 0, 0}, {260, 3, 3}))
          .container;
  int refused = 0;
  for (size_t bit = 0; bit < container.size() * 8; ++bit) {
    auto broken = container;
    broken[bit / 8] ^= std::byte{1} << (bit % 8);
    try {
      const Grid grid = Grid::decode(broken);
      EXPECT_LE(grid.voxel_count(), 1u << 24);
    } catch (const Error& error) {
      ++refused;
      ASSERT_EQ(error.code(), "bad-response") << bit;
    }
  }
  // The rest are the meta's text, origin and voxel size, and dims that still hold the voxels.
  EXPECT_GT(refused, static_cast<int>(container.size()) * 8 / 2);
}

}  // namespace
}  // namespace voxeld::client
