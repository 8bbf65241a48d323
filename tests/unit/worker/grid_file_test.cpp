// Containers that are written while tiles come.
#include "server/worker/grids/grid_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/formats/formats.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

// A few tiles of a wavy sheet, and one that is full.
Grid sheet() {
  Grid grid;
  grid.spec.dims = {1000, 400, 300};
  for (int32_t x = 0; x < 4; ++x) {
    SparseTile& tile = grid.tiles.emplace_back();
    tile.coord = {x, 0, 0};
    for (uint32_t brick = 0; brick < 3000; brick += 1 + static_cast<uint32_t>(x)) {
      tile.brick_morton.push_back(brick);
      tile.masks.emplace_back().words[brick % 8] = 0x9e3779b97f4a7c15u * (brick + 1) | 1;
    }
  }
  SparseTile& full = grid.tiles.emplace_back();
  full.coord = {0, 0, 1};
  full.full = {{0, 2}};
  normalize_tiles(grid);
  return grid;
}

class GridFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() /
              ("grid_file_" +
               std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  // Tiles go in two at a time.
  static void feed(const Grid& grid, GridOutput& output) {
    Grid place = grid;
    place.tiles.clear();
    ASSERT_TRUE(output.begin(place).ok());
    for (size_t i = 0; i < grid.tiles.size(); i += 2) {
      const size_t end = std::min(i + 2, grid.tiles.size());
      ASSERT_TRUE(output
                      .add({grid.tiles.begin() + static_cast<ptrdiff_t>(i),
                            grid.tiles.begin() + static_cast<ptrdiff_t>(end)})
                      .ok());
    }
  }

  size_t files() const {
    size_t count = 0;
    for ([[maybe_unused]] const auto& entry : fs::directory_iterator(folder_)) ++count;
    return count;
  }

  fs::path folder_;
};

TEST_F(GridFileTest, encoding_ends_at_cancellation_points) {
  const Grid grid = sheet();
  GridFile file(folder_ / "grid.voxg", Codec::kFast);
  ASSERT_TRUE(file.begin(grid).ok());
  const std::atomic<bool> flag{true};
  const CancelScope scope(flag);
  EXPECT_THROW((void)file.add(grid.tiles), Cancelled);
  for (const Codec codec : {Codec::kFast, Codec::kSmall}) {
    GridHeader header = container_header(grid);
    header.codecs = StreamCodecs::all(codec);
    EXPECT_THROW((void)encode_tile(grid.tiles.front(), header), Cancelled);  // of the codec itself
  }
}

TEST_F(GridFileTest, has_the_bytes_of_a_container_written_at_once) {
  const Grid grid = sheet();
  for (const size_t pending : {size_t{1} << 20, size_t{0}, size_t{3000}}) {
    for (const Codec codec : {Codec::kFast, Codec::kSmall}) {
      OutputOptions options;
      options.codec = codec;
      const auto expected = encode(grid, options);
      ASSERT_TRUE(expected.ok());
      {
        GridFile file(folder_ / "grid", codec, pending);
        GridOutput output({&file}, false);
        feed(grid, output);
        EXPECT_EQ(output.finish_hash(), content_hash(grid));
        EXPECT_EQ(output.voxel_count(), grid.voxel_count());
        ASSERT_TRUE(file.finish(grid.meta).ok());
      }
      const auto written = read_file(folder_ / "grid");
      ASSERT_TRUE(written.ok());
      EXPECT_TRUE(*written == *expected) << pending;
      EXPECT_EQ(files(), 1u) << "what was spilled stays";
    }
  }
}

TEST_F(GridFileTest, tiles_stay_as_long_as_there_is_room_or_they_are_wanted) {
  const Grid grid = sheet();
  for (const bool keep : {false, true}) {
    for (const size_t room : {size_t{1} << 30, size_t{1000}}) {
      GridFile file(folder_ / "grid", Codec::kFast);
      GridOutput output({&file}, keep, room);
      feed(grid, output);
      const bool stays = keep || room > 1000;
      EXPECT_EQ(output.has_tiles(), stays);
      EXPECT_EQ(output.keeps_tiles(), keep);
      EXPECT_EQ(output.grid().tiles.size(), stays ? grid.tiles.size() : 0u);
      ASSERT_TRUE(file.finish(GridMeta()).ok());
    }
  }
}

TEST_F(GridFileTest, says_where_it_cannot_write) {
  GridFile file(folder_ / "nowhere" / "grid", Codec::kFast, 0);
  GridOutput output({&file}, false);
  Grid place = sheet();
  ASSERT_TRUE(output.begin(Grid{place.spec, {}, {}, {}}).ok());
  const Status status = output.add(place.tiles);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().message(), "create grid.tiles: No such file or directory");
}

}  // namespace
}  // namespace voxeld
