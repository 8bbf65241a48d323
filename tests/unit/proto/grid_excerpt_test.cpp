// Tiles of a container as a container of their own.
#include "proto/container/grid_excerpt.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "proto/container/grid_format.h"
#include "tests/unit/proto/tile_maker.h"

namespace voxeld {
namespace {

using Bytes = std::vector<uint8_t>;

// A row of four tiles with two channels.
Bytes four_tiles() {
  GridHeader header;
  header.dims = {1000, 20, 10};
  header.voxel_size = {0.5, 0.5, 0.125};
  header.channels = {.color = true, .normal = true};
  header.meta_json = R"({"units":"mm"})";
  const auto voxels = test::box_voxels({10, 1, 2}, {990, 4, 3});
  return encode_grid(header, test::tiles_of(voxels, true, true)).value();
}

Bytes whole_excerpt(const Bytes& container, const GridExcerpt& excerpt) {
  Bytes bytes = excerpt.front;
  bytes.insert(bytes.end(), container.begin() + static_cast<ptrdiff_t>(excerpt.first_byte),
               container.begin() + static_cast<ptrdiff_t>(excerpt.end_byte));
  return bytes;
}

std::string excerpt_refusal(const Bytes& container, size_t first) {
  const auto excerpt = excerpt_tiles(container, first, 1, "{}");
  return excerpt ? "" : excerpt.error().message();
}

TEST(GridExcerpt, every_run_of_tiles_decodes_as_in_its_container) {
  const Bytes container = four_tiles();
  const auto whole = GridReader::open(container);
  ASSERT_TRUE(whole);
  ASSERT_EQ(whole->tile_count(), 4u);
  for (size_t first = 0; first < 4; ++first) {
    for (size_t count = 1; count <= 5; ++count) {
      const auto excerpt = excerpt_tiles(container, first, count, R"({"first_tile":7})");
      ASSERT_TRUE(excerpt) << excerpt.error().message();
      const Bytes bytes = whole_excerpt(container, *excerpt);
      const auto part = GridReader::open(bytes);
      ASSERT_TRUE(part) << part.error().message();
      ASSERT_EQ(part->tile_count(), std::min(count, 4 - first));
      EXPECT_EQ(excerpt->tile_count, part->tile_count());
      EXPECT_EQ(part->header().meta_json, R"({"first_tile":7})");
      EXPECT_EQ(part->header().dims, whole->header().dims);
      EXPECT_EQ(part->header().channels, whole->header().channels);
      for (size_t i = 0; i < part->tile_count(); ++i) {
        const auto tile = part->decode_tile(i), same = whole->decode_tile(first + i);
        ASSERT_TRUE(tile && same);
        EXPECT_EQ(tile->coord, same->coord);
        EXPECT_EQ(tile->masks, same->masks);
        EXPECT_EQ(tile->color, same->color);
        EXPECT_EQ(tile->normal, same->normal);
      }
    }
  }
}

TEST(GridExcerpt, all_tiles_with_the_same_meta_are_the_container) {
  const Bytes container = four_tiles();
  const auto excerpt = excerpt_tiles(container, 0, 4, R"({"units":"mm"})");
  ASSERT_TRUE(excerpt);
  EXPECT_EQ(whole_excerpt(container, *excerpt), container);
}

TEST(GridExcerpt, a_tile_that_is_not_there_is_refused) {
  EXPECT_EQ(excerpt_refusal(four_tiles(), 4),
            "grid container, byte 80: tile count: expected above 4, got 4");
}

TEST(GridExcerpt, containers_that_break_the_format_are_refused) {
  const Bytes container = four_tiles();
  constexpr size_t kEntries = kGridHeaderBytes + 16, kEntry = 48;
  EXPECT_EQ(excerpt_refusal(Bytes(200, 0), 0),
            "grid container, byte 0: not a grid container: expected the magic VOXGRID, got other "
            "bytes");
  for (size_t bytes = 0; bytes < kEntries + 4 * kEntry; bytes += 8) {
    EXPECT_NE(excerpt_refusal(Bytes(container.begin(), container.begin() + bytes), 0), "") << bytes;
  }
  Bytes gap = container;
  ++gap[kEntries + kEntry + 24];
  const auto cut = excerpt_tiles(gap, 0, 2, "{}");
  ASSERT_FALSE(cut);
  EXPECT_TRUE(cut.error().message().starts_with("grid container, byte 216: tiles have gaps"))
      << cut.error().message();
  Bytes beyond = container;
  beyond[kEntries + 24 + 7] = 0x7f;
  EXPECT_EQ(excerpt_refusal(beyond, 0), "grid container, byte 168: tile data lie beyond the end");
}

}  // namespace
}  // namespace voxeld
