#include "server/formats/formats.h"

#include <gtest/gtest.h>

#include <string>

#include "proto/limits.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using test::to;

TEST(Formats, each_begins_with_its_magic) {
  const Grid grid = test::random_grid(1, {9, 8, 7}, 20, true, true);
  for (const auto& [format, magic] : {std::pair{Format::kNative, "VOXGRID"},
                                      {Format::kNpy, "\x93NUMPY"},
                                      {Format::kNpz, "PK\x03\x04"},
                                      {Format::kVox, "VOX "}}) {
    const auto bytes = encode(grid, to(format));
    ASSERT_TRUE(bytes) << format_name(format);
    EXPECT_TRUE(std::string(bytes->begin(), bytes->end()).starts_with(magic))
        << format_name(format);
  }
}

TEST(Formats, dense_ones_have_a_limit_of_cells_that_is_told_before_anything_is_computed) {
  GridSpec spec;
  spec.dims = {2048, 1024, 1024};  // 2^31 cells
  for (const Format format : {Format::kNpy, Format::kNpz}) {
    EXPECT_TRUE(check_encodable(spec, to(format)));
  }
  spec.dims = {2048, 1024, 1025};
  for (const Format format : {Format::kNpy, Format::kNpz}) {
    const Status status = check_encodable(spec, to(format));
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, ErrorCode::kGridTooLarge);
    EXPECT_EQ(status.error().message(),
              std::string(format_name(format)) +
                  " is dense: too many cells (layout=sparse is not, nor are formats " +
                  sparse_format_names() +
                  "): expected at most "
                  "2147483648 cells, got 2149580800");
  }
  EXPECT_TRUE(check_encodable(spec, to(Format::kNative)));
}

TEST(Formats, too_large_grids_are_refused_by_encode_too) {
  Grid grid;
  grid.spec.dims = glm::ivec3(limits::kGridSideMax);
  EXPECT_TRUE(encode(grid, to(Format::kNative)));
  EXPECT_TRUE(encode(grid, to(Format::kVox)));
  for (const Format format : {Format::kNpy, Format::kNpz}) {
    const auto bytes = encode(grid, to(format));
    ASSERT_FALSE(bytes) << format_name(format);
    EXPECT_EQ(bytes.error().code, ErrorCode::kGridTooLarge);
  }
}

TEST(Xyz, more_voxels_than_points_may_be_are_refused_before_they_are_written) {
  Grid grid;
  grid.spec.dims = {4 * limits::kTileSide + 1, limits::kTileSide, limits::kTileSide};
  for (int x = 0; x < 4; ++x) {
    SparseTile tile;
    tile.coord = {x, 0, 0};
    tile.full = {{0, kTileLevels}};
    grid.tiles.push_back(tile);
  }
  ASSERT_EQ(grid.voxel_count(), kXyzPointsMax);
  SparseTile one_more;
  one_more.coord = {4, 0, 0};
  one_more.full = {{0, 0}};
  grid.tiles.push_back(one_more);
  EXPECT_EQ(encode(grid, to(Format::kXyz)).error().message(),
            "xyz: too many voxels for points: expected at most 67108864, got 67109376");
}

}  // namespace
}  // namespace voxeld
