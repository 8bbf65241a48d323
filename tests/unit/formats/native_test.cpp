// The container through the formats' own door; its fields are tested in tests/unit/proto.
#include <gtest/gtest.h>

#include <string>

#include "server/formats/formats.h"
#include "server/grid/content_hash.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

std::vector<uint8_t> native(const Grid& grid) {
  const auto bytes = encode(grid, {});
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return bytes ? *bytes : std::vector<uint8_t>();
}

TEST(Native, random_grids_come_back) {
  for (uint32_t seed = 0; seed < 12; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const std::array<int, 3> dims = {1 + test::below(random, 600), 1 + test::below(random, 600),
                                     1 + test::below(random, 300)};
    const Grid grid = test::random_grid(seed, dims, 2000, (seed & 1) != 0, (seed & 2) != 0);
    const auto back = grid_from_container(native(grid));
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_TRUE(back->tiles == grid.tiles);
    EXPECT_EQ(back->meta, grid.meta);
    EXPECT_EQ(content_hash(*back), content_hash(grid));
  }
}

TEST(Native, every_prefix_is_refused) {
  const auto bytes = native(test::random_grid(1, {300, 20, 20}, 60, true, true));
  for (size_t size = 0; size < bytes.size(); ++size) {
    const auto grid = grid_from_container(std::span(bytes).first(size));
    ASSERT_FALSE(grid) << size;
    EXPECT_EQ(grid.error().code, ErrorCode::kBadRequest);
  }
}

TEST(Native, flipped_bytes_are_refused_or_give_a_grid_that_can_be_written) {
  const auto bytes = native(test::random_grid(2, {300, 20, 20}, 60, true, true));
  std::mt19937 random(3);
  for (int round = 0; round < 5000; ++round) {
    auto flipped = bytes;
    for (int flips = 1 + round % 3; flips > 0; --flips) {
      uint8_t& byte =
          flipped[static_cast<size_t>(test::below(random, static_cast<int>(bytes.size())))];
      byte = static_cast<uint8_t>(random());
    }
    const auto grid = grid_from_container(flipped);
    if (!grid) {
      EXPECT_EQ(grid.error().code, ErrorCode::kBadRequest);
      EXPECT_TRUE(grid.error().detail.starts_with("grid container")) << grid.error().detail;
    } else {
      EXPECT_TRUE(encode(*grid, {})) << "what is read can be written";
    }
  }
}

}  // namespace
}  // namespace voxeld
