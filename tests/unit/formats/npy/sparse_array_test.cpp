// Arrays with a row for each voxel, compared with the dense arrays of the same grid and with a
// Morton order that is computed bit by bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <type_traits>

#include "proto/limits.h"
#include "server/formats/npy/npy_array.h"
#include "server/formats/npy/sparse_array.h"
#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using Cell = std::array<int32_t, 3>;

uint64_t morton(const Cell& cell) {
  uint64_t code = 0;
  for (unsigned bit = 0; bit < 20; ++bit) {
    for (unsigned c = 0; c < 3; ++c) {
      code |= (static_cast<uint64_t>(cell[c]) >> bit & 1) << (3 * bit + c);
    }
  }
  return code;
}

OutputOptions sparse(DType dtype = DType::kUint8) {
  OutputOptions options;
  options.layout = ArrayLayout::kSparse;
  options.dtype = dtype;
  return options;
}

std::vector<uint8_t> bytes_of(std::vector<uint8_t> npy, const SparseArray& array) {
  const size_t header_bytes = npy.size();
  npy.resize(header_bytes + array.bytes(), 0xa5);
  for (size_t i = array.piece_count(); i-- > 0;) {
    array.fill(i,
               std::span(npy).subspan(header_bytes + array.piece_begin(i), array.piece_bytes(i)));
  }
  return npy;
}

test::NpyArray coords_of(const VoxelPieces& voxels, std::optional<int32_t> frame = {}) {
  return test::read_npy(bytes_of(coords_header(voxels.voxel_count(), frame.has_value()),
                                 SparseArray::coords(voxels, frame)));
}

std::vector<Cell> cells_of(const test::NpyArray& coords) {
  std::vector<Cell> cells(static_cast<size_t>(coords.shape[0]));
  std::memcpy(cells.data(), coords.data.data(), coords.data.size());
  return cells;
}

// The cells of the dense array, by their Morton codes.
std::vector<Cell> cells_by_morton(const Grid& grid) {
  const auto dense = test::read_npy(test::npy_of(grid, std::nullopt, {}));
  std::vector<Cell> cells;
  for (int32_t z = 0; z < grid.spec.dims.z; ++z) {
    for (int32_t y = 0; y < grid.spec.dims.y; ++y) {
      for (int32_t x = 0; x < grid.spec.dims.x; ++x) {
        if (dense.data[dense.at({z, y, x})] != 0) cells.push_back({x, y, z});
      }
    }
  }
  std::ranges::sort(cells, {}, morton);
  return cells;
}

Grid with_random_samples(Grid grid) {
  std::mt19937 random(7);
  for (SparseTile& tile : grid.tiles) {
    for_each_channel(tile, [&](Channel, auto& samples) {
      for (auto& sample : samples) sample = static_cast<std::decay_t<decltype(sample)>>(random());
    });
  }
  return grid;
}

ChannelSet all_channels() {
  ChannelSet channels;
  for (const ChannelInfo& info : kChannels) channels.set(info.channel);
  return channels;
}

// Several tiles, and full nodes of one brick and of eight between the masks.
Grid mixed_grid(const ChannelSet& channels) {
  std::mt19937 random(3);
  Grid grid =
      test::grid_of({560, 140, 64}, test::random_voxels(random, {56, 140, 40}, 3000), channels);
  grid.tiles[0].full = {{morton_encode(8, 1, 1), 0}, {morton_encode(10, 2, 4), 1}};
  std::ranges::sort(grid.tiles[0].full, {}, &FullNode::brick_morton);
  SparseTile& far_tile = grid.tiles.emplace_back();
  far_tile.coord = {2, 0, 0};
  far_tile.full = {{0, 2}};
  normalize_tiles(grid);
  return with_random_samples(std::move(grid));
}

TEST(SparseArray, coords_are_the_occupied_cells_in_morton_order) {
  for (const Grid& grid : {test::random_grid(1, {10, 11, 12}, 50, true, false),
                           test::random_grid(2, {700, 300, 200}, 4000, false, false),
                           test::grid_with_a_full_brick(true, true), mixed_grid({})}) {
    const auto coords = coords_of(VoxelPieces(grid));
    EXPECT_EQ(coords.descr, "<i4");
    EXPECT_FALSE(coords.fortran);
    EXPECT_EQ(coords.shape, (std::vector<int64_t>{static_cast<int64_t>(grid.voxel_count()), 3}));
    EXPECT_EQ(cells_of(coords), cells_by_morton(grid));
  }
}

TEST(SparseArray, rows_of_a_channel_are_the_dense_array_at_the_coords) {
  const Grid grid = mixed_grid(all_channels());
  const VoxelPieces voxels(grid);
  const std::vector<Cell> cells = cells_of(coords_of(voxels));
  ASSERT_FALSE(cells.empty());
  for (const ChannelInfo& info : kChannels) {
    for (const DType dtype : {DType::kUint8, DType::kBool, DType::kFloat32}) {
      const OutputOptions options = sparse(dtype);
      OutputOptions of_dense;
      of_dense.dtype = dtype;
      const auto dense = test::read_npy(test::npy_of(grid, info.channel, of_dense));
      const auto rows = test::read_npy(bytes_of(rows_header(cells.size(), info.channel, options),
                                                SparseArray(voxels, info.channel, options)));
      EXPECT_EQ(rows.descr, dense.descr) << info.name;
      const NpyType type = npy_type(info.channel, options);
      const size_t row_bytes = type.components * type.sample_bytes;
      ASSERT_EQ(rows.data.size(), cells.size() * row_bytes) << info.name;
      size_t different = 0;
      for (size_t i = 0; i < cells.size(); ++i) {
        const auto& [x, y, z] = cells[i];
        std::vector<int64_t> at = {z, y, x};
        if (type.components > 1) at.push_back(0);
        different += std::memcmp(dense.data.data() + dense.at(at) * type.sample_bytes,
                                 rows.data.data() + i * row_bytes, row_bytes) == 0
                         ? 0
                         : 1;
      }
      EXPECT_EQ(different, 0u) << info.name;
    }
  }
}

TEST(SparseArray, the_frame_is_a_column_before_the_cell) {
  const Grid grid = mixed_grid({});
  const auto coords = coords_of(VoxelPieces(grid), 41);
  const std::vector<Cell> cells = cells_by_morton(grid);
  ASSERT_EQ(coords.shape, (std::vector<int64_t>{static_cast<int64_t>(cells.size()), 4}));
  const auto rows = coords.as<int32_t>();
  for (size_t i = 0; i < cells.size(); ++i) {
    ASSERT_EQ(rows[4 * i], 41);
    ASSERT_EQ((Cell{rows[4 * i + 1], rows[4 * i + 2], rows[4 * i + 3]}), cells[i]) << i;
  }
}

TEST(SparseArray, pieces_end_with_the_brick_that_fills_them) {
  Grid grid;
  grid.spec.dims = {320, 64, 64};
  for (const int32_t x : {0, 1}) {
    SparseTile& tile = grid.tiles.emplace_back();
    tile.coord = {x, 0, 0};
    tile.full = {{0, 3}};  // 64 voxels a side
  }
  const VoxelPieces voxels(grid);
  ASSERT_EQ(voxels.voxel_count(), grid.voxel_count());
  ASSERT_EQ(voxels.count(), grid.voxel_count() / VoxelPieces::kPieceVoxels);
  for (size_t i = 0; i < voxels.count(); ++i) {
    EXPECT_EQ(voxels.begin(i), i * VoxelPieces::kPieceVoxels);
  }
  EXPECT_EQ(cells_of(coords_of(voxels)), cells_by_morton(grid));
}

TEST(SparseArray, an_empty_grid_has_arrays_without_rows) {
  Grid grid;
  grid.spec.dims = glm::ivec3(8);
  const VoxelPieces voxels(grid);
  EXPECT_EQ(voxels.count(), 0u);
  EXPECT_EQ(coords_of(voxels).shape, (std::vector<int64_t>{0, 3}));
}

TEST(SparseArray, npy_is_the_coords_alone) {
  const Grid grid = mixed_grid(all_channels());
  const VoxelPieces voxels(grid);
  const auto bytes = test::encode_as(Format::kNpy, grid, sparse());
  ASSERT_TRUE(bytes) << bytes.error().message();
  EXPECT_EQ(*bytes, bytes_of(coords_header(voxels.voxel_count(), false),
                             SparseArray::coords(voxels, std::nullopt)));
}

TEST(SparseArray, no_number_of_cells_is_too_large_but_one_of_voxels) {
  GridSpec spec;
  spec.dims = glm::ivec3(limits::kGridSideMax);
  OutputOptions options = sparse();
  for (const Format format : {Format::kNpy, Format::kNpz}) {
    options.format = format;
    EXPECT_TRUE(check_encodable(spec, options));
    EXPECT_TRUE(check_sequence_encodable(spec, 1000, options));
  }
  Grid grid;
  grid.spec = spec;
  for (uint32_t i = 0; i < 17; ++i) {
    const auto at = morton_decode(i);
    SparseTile& tile = grid.tiles.emplace_back();
    for (size_t c = 0; c < 3; ++c) tile.coord[c] = static_cast<int32_t>(at[c]);
    tile.full = {{0, kTileLevels}};
  }
  ASSERT_EQ(grid.voxel_count(), limits::kSparseVoxelsMax / 16 * 17);
  for (const Format format : {Format::kNpy, Format::kNpz}) {
    const auto bytes = test::encode_as(format, grid, sparse());
    ASSERT_FALSE(bytes);
    EXPECT_EQ(bytes.error().code, ErrorCode::kGridTooLarge);
    EXPECT_EQ(bytes.error().message(),
              std::string(format_name(format)) +
                  ": too many voxels for sparse arrays: expected at most 268435456 voxels, got "
                  "285212672");
  }
}

}  // namespace
}  // namespace voxeld
