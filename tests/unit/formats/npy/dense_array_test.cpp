// Pieces of dense arrays against an array that is filled voxel by voxel.
#include "server/formats/npy/dense_array.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "proto/codec/tile_runs.h"
#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

struct Made {
  std::vector<test::TestVoxel> voxels;
  Grid grid;
};

// Cells of more than one tile in rows and planes that no brick divides.
Made made(uint32_t seed, const std::array<int, 3>& dims, int count) {
  std::mt19937 random(seed);
  Made made;
  made.voxels = test::random_voxels(random, dims, count);
  std::ranges::sort(made.voxels, {}, &test::TestVoxel::cell);
  const auto end = std::unique(made.voxels.begin(), made.voxels.end(),
                               [](const auto& a, const auto& b) { return a.cell == b.cell; });
  made.voxels.erase(end, made.voxels.end());
  made.grid = test::grid_of(dims, made.voxels, true, true);
  return made;
}

TEST(DenseArray, pieces_follow_each_other_and_none_is_too_long) {
  for (const std::array<int, 3>& dims : {std::array{600, 37, 45}, std::array{1, 1, 1},
                                         std::array{3, 2000, 9}, std::array{16384, 9, 2}}) {
    const Made sample = made(1, dims, 50);
    for (const AxisOrder axes : {AxisOrder::kZyx, AxisOrder::kXyz}) {
      for (const DType dtype : {DType::kUint8, DType::kFloat32}) {
        OutputOptions options;
        options.axes = axes;
        options.dtype = dtype;
        const DenseArray array(sample.grid, Channel::kColor, options);
        const size_t sample_bytes = dtype == DType::kFloat32 ? 4 : 1;
        const auto row_bytes =
            static_cast<size_t>(dims[0]) * sample_bytes * (axes == AxisOrder::kZyx ? 4 : 1);
        EXPECT_EQ(array.bytes(),
                  size_t{4} * sample_bytes * static_cast<size_t>(dims[0] * dims[1] * dims[2]));
        EXPECT_EQ(array.piece_begin(0), 0u);
        EXPECT_EQ(array.piece_begin(array.piece_count()), array.bytes());
        for (size_t i = 0; i < array.piece_count(); ++i) {
          EXPECT_GT(array.piece_begin(i + 1), array.piece_begin(i));
          EXPECT_LE(array.piece_bytes(i), std::max(DenseArray::kPieceBytes, 8 * row_bytes));
        }
      }
    }
  }
}

TEST(DenseArray, pieces_have_each_voxel_at_its_place_and_nothing_else) {
  uint32_t seed = 0;
  for (const std::array<int, 3>& dims : {std::array{600, 37, 45}, std::array{7, 9, 600},
                                         std::array{5, 600, 8}, std::array{1, 1, 1}}) {
    const int cells = dims[0] * dims[1] * dims[2];
    const Made sample = made(++seed, dims, std::min(cells, 4000));
    for (const AxisOrder axes : {AxisOrder::kZyx, AxisOrder::kXyz}) {
      OutputOptions options;
      options.axes = axes;
      const auto cell_of = [&](const test::TestVoxel& voxel) {
        return static_cast<size_t>((voxel.cell[2] * dims[1] + voxel.cell[1]) * dims[0] +
                                   voxel.cell[0]);
      };
      const auto all = static_cast<size_t>(cells);
      const auto at = [&](size_t cell, size_t component, size_t components) {
        return axes == AxisOrder::kXyz ? component * all + cell : cell * components + component;
      };
      std::vector<uint8_t> occupancy(all), color(4 * all), normal(3 * all);
      for (const test::TestVoxel& voxel : sample.voxels) {
        const size_t cell = cell_of(voxel);
        occupancy[cell] = 1;
        for (size_t c = 0; c < 4; ++c) color[at(cell, c, 4)] = voxel.color[c];
        for (size_t c = 0; c < 3; ++c)
          normal[at(cell, c, 3)] = static_cast<uint8_t>(voxel.normal[c]);
      }
      const auto samples = [&](std::optional<Channel> channel) {
        return test::read_npy(test::npy_of(sample.grid, channel, options)).data;
      };
      EXPECT_TRUE(samples(std::nullopt) == occupancy) << dims[0];
      EXPECT_TRUE(samples(Channel::kColor) == color) << dims[0];
      EXPECT_TRUE(samples(Channel::kNormal) == normal) << dims[0];
    }
  }
}

TEST(DenseArray, full_nodes_fill_their_cells_in_every_piece) {
  Grid grid = test::grid_of({600, 40, 80}, {{{0, 0, 0}, {1, 2, 3, 4}, {5, 6, 7}}},
                            ChannelSet{.coverage = true});
  grid.tiles[0].full = {{morton_encode(2, 2, 2), 1}, {morton_encode(60, 4, 8), 0}};
  grid.tiles[0].coverage = {9};
  std::vector<uint8_t> occupancy(size_t{600} * 40 * 80), coverage(occupancy.size());
  occupancy[0] = 1;
  coverage[0] = 9;
  for_each_full_run(grid.tiles[0], [&](int x, int y, int z, int length) {
    for (int i = 0; i < length; ++i) {
      const auto cell = static_cast<size_t>((z * 40 + y) * 600 + x + i);
      occupancy[cell] = 1;
      coverage[cell] = 255;
    }
  });
  EXPECT_TRUE(test::read_npy(test::npy_of(grid, std::nullopt, {})).data == occupancy);
  EXPECT_TRUE(test::read_npy(test::npy_of(grid, Channel::kCoverage, {})).data == coverage);
}

}  // namespace
}  // namespace voxeld
