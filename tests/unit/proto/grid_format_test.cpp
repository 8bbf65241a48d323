#include "proto/container/grid_format.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <random>
#include <string>

#include "proto/container/grid_streams.h"
#include "proto/container/grid_writer.h"
#include "tests/unit/proto/tile_maker.h"

namespace voxeld {
namespace {

using Bytes = std::vector<uint8_t>;

template <typename T>
void put(Bytes& bytes, size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}
template <typename T>
T get(const Bytes& bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

GridHeader header_of(const std::array<int32_t, 3>& dims, const ChannelSet& channels) {
  GridHeader header;
  header.dims = dims;
  header.origin = {-1.5, 0.25, 1e10};
  header.voxel_size = {0.5, 0.5, 0.125};
  header.channels = channels;
  header.meta_json = R"({"units":"mm"})";
  return header;
}
GridHeader header_of(const std::array<int32_t, 3>& dims, bool color, bool normal) {
  return header_of(dims, {.color = color, .normal = normal});
}

// Two tiles with two channels; the directory begins at 128 + 16.
constexpr size_t kDirectory = kGridHeaderBytes + 16;
Bytes two_tiles() {
  const auto voxels = test::box_voxels({254, 1, 2}, {259, 4, 3});
  const auto bytes =
      encode_grid(header_of({300, 20, 10}, true, true), test::tiles_of(voxels, true, true));
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return bytes ? *bytes : Bytes();
}

std::string container_refusal(const Bytes& bytes) {
  const auto reader = GridReader::open(bytes);
  if (!reader) {
    EXPECT_EQ(reader.error().code, ErrorCode::kBadRequest);
    return reader.error().message();
  }
  for (size_t i = 0; i < reader->tile_count(); ++i) {
    if (const auto tile = reader->decode_tile(i); !tile) {
      EXPECT_EQ(tile.error().code, ErrorCode::kBadRequest);
      return tile.error().message();
    }
  }
  return "";
}

void expect_container_round_trip(const GridHeader& header, const std::vector<SparseTile>& tiles) {
  const auto bytes = encode_grid(header, tiles);
  ASSERT_TRUE(bytes) << bytes.error().message();
  const auto reader = GridReader::open(*bytes);
  ASSERT_TRUE(reader) << reader.error().message();
  EXPECT_EQ(reader->header().dims, header.dims);
  EXPECT_EQ(reader->header().origin, header.origin);
  EXPECT_EQ(reader->header().voxel_size, header.voxel_size);
  EXPECT_EQ(reader->header().channels, header.channels);
  EXPECT_EQ(reader->header().meta_json, header.meta_json);
  ASSERT_EQ(reader->tile_count(), tiles.size());
  uint64_t voxels = 0;
  for (size_t i = 0; i < reader->tile_count(); ++i) {
    const auto tile = reader->decode_tile(i);
    ASSERT_TRUE(tile) << tile.error().message();
    const auto same = std::ranges::find(tiles, tile->coord, &SparseTile::coord);
    ASSERT_NE(same, tiles.end());
    EXPECT_TRUE(*tile == *same);
    EXPECT_EQ(reader->tile_voxel_count(i), tile->voxel_count());
    voxels += tile->voxel_count();
  }
  EXPECT_EQ(reader->voxel_count(), voxels);
}

TEST(GridFormat, random_grids_come_back_with_each_set_of_channels) {
  for (uint32_t seed = 0; seed < test::kChannelSets; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const std::array<int, 3> dims = {1 + test::below(random, 700), 1 + test::below(random, 300),
                                     1 + test::below(random, 300)};
    const ChannelSet channels = channels_of_bits(seed);
    EXPECT_EQ(channel_bits(channels), seed);
    expect_container_round_trip(header_of(dims, channels),
                                test::tiles_of(test::random_voxels(random, dims, 3000), channels));
  }
}

TEST(GridFormat, full_nodes_come_back_with_each_set_of_channels_and_codec) {
  for (uint32_t seed = 0; seed < 16; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const ChannelSet channels = channels_of_bits(seed * 21);  // each channel on and off
    std::vector<SparseTile> tiles;
    for (int i = 0; i < 3; ++i) {
      tiles.push_back(test::tile_with_full_nodes(random, channels));
      tiles.back().coord = {i, 2 * i, 1};
    }
    GridHeader header = header_of({768, 2048, 512}, channels);
    if ((seed & 4) != 0) header.codecs.octree = Codec::kSmall;
    expect_container_round_trip(header, tiles);
  }
}

TEST(GridFormat, equal_voxels_without_attributes_give_equal_bytes) {
  std::mt19937 random(7);
  const GridHeader header = header_of({256, 256, 256}, false, false);
  const SparseTile tile = test::tile_with_full_nodes(random, false, false);
  SparseTile spelled;
  for_each_brick(tile, [&](uint32_t morton, const BrickMask& mask, size_t) {
    spelled.brick_morton.push_back(morton);
    spelled.masks.push_back(mask);
  });
  ASSERT_FALSE(tile.full.empty());
  const auto canonical = encode_grid(header, std::span(&tile, 1));
  const auto other = encode_grid(header, std::span(&spelled, 1));
  ASSERT_TRUE(canonical && other);
  EXPECT_EQ(*canonical, *other);
}

TEST(GridFormat, a_full_tile_has_no_bricks_and_no_attribute_streams) {
  SparseTile tile;
  tile.coord = {1, 0, 0};
  tile.full = {{0, kTileLevels}};
  const auto bytes = encode_grid(header_of({512, 256, 256}, true, true), std::span(&tile, 1));
  ASSERT_TRUE(bytes);
  EXPECT_EQ(get<uint32_t>(*bytes, kDirectory + 12), 0u);
  EXPECT_EQ(get<uint64_t>(*bytes, kDirectory + 16), uint64_t{1} << 24);
  EXPECT_EQ(get<uint32_t>(*bytes, kDirectory + 36), 0u);
  EXPECT_EQ(get<uint32_t>(*bytes, kDirectory + 40), 0u);
  EXPECT_LT(bytes->size(), kDirectory + 48 + 30);
  const auto reader = GridReader::open(*bytes);
  ASSERT_TRUE(reader);
  const auto back = reader->decode_tile(0);
  ASSERT_TRUE(back);
  EXPECT_TRUE(*back == tile);
  Bytes smaller = *bytes;
  put(smaller, 16, 511);
  EXPECT_EQ(container_refusal(smaller), "grid container, byte 0: a tile has voxels outside dims");
}

TEST(GridFormat, an_empty_grid_and_the_largest_dims_come_back) {
  expect_container_round_trip(header_of({1, 1, 1}, true, false), {});
  expect_container_round_trip(
      header_of({2048, 2048, 2048}, false, true),
      test::tiles_of({{{2047, 2047, 2047}, {}, {1, 2, 3}}, {{0, 0, 0}, {}, {}}}, false, true));
}

TEST(GridFormat, the_bytes_lie_where_the_byte_map_says) {
  const Bytes bytes = two_tiles();
  EXPECT_EQ(std::memcmp(bytes.data(), "VOXGRID\0", 8), 0);
  EXPECT_EQ(get<uint32_t>(bytes, 8), 3u);
  EXPECT_EQ(get<uint32_t>(bytes, 12), 3u);
  EXPECT_EQ(get<int32_t>(bytes, 16), 300);
  EXPECT_EQ(get<int32_t>(bytes, 24), 10);
  EXPECT_EQ(get<uint32_t>(bytes, 28), 8u);
  EXPECT_EQ(get<double>(bytes, 32), -1.5);
  EXPECT_EQ(get<double>(bytes, 72), 0.125);
  EXPECT_EQ(get<uint32_t>(bytes, 80), 2u);
  EXPECT_EQ(get<uint32_t>(bytes, 84), 14u);
  EXPECT_EQ(get<uint64_t>(bytes, 88), 15u);
  EXPECT_EQ(get<uint64_t>(bytes, 96), bytes.size());
  EXPECT_EQ(std::memcmp(bytes.data() + 128, R"({"units":"mm"})", 14), 0);
  EXPECT_EQ(get<int32_t>(bytes, kDirectory + 48), 1);    // second tile: x
  EXPECT_EQ(get<uint32_t>(bytes, kDirectory + 12), 1u);  // bricks
  EXPECT_EQ(get<uint64_t>(bytes, kDirectory + 16), 6u);  // voxels
  EXPECT_EQ(get<uint64_t>(bytes, kDirectory + 24), kDirectory + 96);
}

TEST(GridFormat, streams_and_directory_entries_are_as_many_as_channels) {
  std::vector<test::TestVoxel> voxels(1);
  voxels[0].material = 0x1234;
  voxels[0].label = 0xfedc;
  voxels[0].distance = -2;
  voxels[0].coverage = 7;
  const std::vector<std::pair<uint32_t, size_t>> entry_bytes = {
      {0, 40}, {4, 40}, {4 + 16, 48}, {4 + 8 + 16, 48}, {1 + 4 + 8 + 16, 56}, {63, 64}};
  for (const auto& [bits, size] : entry_bytes) {
    SCOPED_TRACE(bits);
    const ChannelSet channels = channels_of_bits(bits);
    EXPECT_EQ(grid_entry_bytes(channels), size);
    const auto bytes =
        encode_grid(header_of({9, 9, 9}, channels), test::tiles_of(voxels, channels));
    ASSERT_TRUE(bytes);
    EXPECT_EQ(get<uint32_t>(*bytes, 12), bits);
    EXPECT_EQ(get<uint64_t>(*bytes, kDirectory + 24), kDirectory + size);
    uint64_t end = kDirectory + size + get<uint32_t>(*bytes, kDirectory + 32);
    for (size_t i = 0; i < channels.count(); ++i) {
      end += get<uint32_t>(*bytes, kDirectory + 36 + 4 * i);
    }
    EXPECT_EQ(end, bytes->size());
  }
}

TEST(GridFormat, equal_grids_give_equal_bytes_whatever_the_order_of_tiles) {
  std::mt19937 random(3);
  auto tiles = test::tiles_of(test::random_voxels(random, {600, 600, 600}, 500), true, false);
  ASSERT_GT(tiles.size(), 4u);
  const GridHeader header = header_of({600, 600, 600}, true, false);
  const auto first = encode_grid(header, tiles);
  std::ranges::shuffle(tiles, random);
  tiles.insert(tiles.begin() + 2, SparseTile{{2, 2, 2}, {}, {}, {}});  // empty: left out
  const auto second = encode_grid(header, tiles);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(*first, *second);
}

TEST(GridFormat, all_tiles_decoded_at_once_equal_each_alone) {
  std::mt19937 random(6);
  const auto tiles = test::tiles_of(test::random_voxels(random, {900, 900, 900}, 900), true, true);
  auto bytes = encode_grid(header_of({900, 900, 900}, true, true), tiles);
  ASSERT_TRUE(bytes);
  const auto reader = GridReader::open(*bytes);
  ASSERT_TRUE(reader);
  ASSERT_GT(reader->tile_count(), 10u);
  const auto all = reader->decode_tiles();
  ASSERT_TRUE(all);
  ASSERT_EQ(all->size(), reader->tile_count());
  for (size_t i = 0; i < all->size(); ++i) EXPECT_TRUE((*all)[i] == *reader->decode_tile(i)) << i;

  // Two broken tiles: the error of the first.
  for (const size_t i : {size_t{7}, size_t{3}}) {
    put(*bytes, kDirectory + 48 * i + 12, 99'999u);
  }
  const auto broken = GridReader::open(*bytes);
  ASSERT_TRUE(broken);
  EXPECT_EQ(broken->decode_tiles().error().message(), broken->decode_tile(3).error().message());
}

TEST(GridFormat, the_byte_range_of_a_tile_is_its_data_and_ranges_follow_each_other) {
  const Bytes bytes = two_tiles();
  const auto reader = GridReader::open(bytes);
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader->tile_coord(1), (std::array<int32_t, 3>{1, 0, 0}));
  const auto [first, first_size] = reader->tile_byte_range(0);
  const auto [second, second_size] = reader->tile_byte_range(1);
  EXPECT_EQ(first, kDirectory + 2 * grid_entry_bytes({.color = true, .normal = true}));
  EXPECT_EQ(second, first + first_size);
  EXPECT_EQ(second + second_size, bytes.size());
}

TEST(GridFormat, every_truncation_and_every_extra_byte_is_refused) {
  const Bytes bytes = two_tiles();
  EXPECT_EQ(container_refusal(bytes), "");
  for (size_t size = 0; size < bytes.size(); ++size) {
    const Bytes cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_NE(container_refusal(cut), "") << size;
  }
  EXPECT_EQ(container_refusal({}),
            "grid container, byte 0: the header is cut off: expected 128 bytes, got 0");
  Bytes longer = bytes;
  longer.push_back(0);
  EXPECT_EQ(container_refusal(longer), "grid container, byte 96: length: expected " +
                                           std::to_string(bytes.size()) + " bytes, got " +
                                           std::to_string(longer.size()));
  put(longer, 96, uint64_t{longer.size()});
  EXPECT_EQ(container_refusal(longer),
            "grid container, byte " + std::to_string(bytes.size()) + ": bytes after the last tile");
}

struct Corruption {
  std::function<void(Bytes&)> change;
  std::string text;
};

void expect_refused(const std::vector<Corruption>& corruptions) {
  const Bytes good = two_tiles();
  for (const auto& [change, text] : corruptions) {
    Bytes bytes = good;
    change(bytes);
    EXPECT_EQ(container_refusal(bytes), "grid container, byte " + text);
  }
}

TEST(GridFormat, every_field_of_the_header_is_checked) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_refused({
      {[](Bytes& b) { b[0] = 'v'; },
       "0: not a grid container: expected the magic VOXGRID, got other bytes"},
      {[](Bytes& b) { b[7] = 1; },
       "0: not a grid container: expected the magic VOXGRID, got other bytes"},
      {[](Bytes& b) { put(b, 8, 2u); }, "8: version: expected 3, got 2"},
      {[](Bytes& b) { put(b, 12, 67u); }, "12: unknown channels"},
      {[](Bytes& b) { put(b, 16, 0); }, "16: dims: expected 1 to 16384, got 0"},
      {[](Bytes& b) { put(b, 20, 16385); }, "16: dims: expected 1 to 16384, got 16385"},
      {[](Bytes& b) { put(b, 24, -5); }, "16: dims: expected 1 to 16384, got -5"},
      {[](Bytes& b) { put(b, 28, 9u); }, "28: tile side: expected 8, got another"},
      {[nan](Bytes& b) { put(b, 32, nan); }, "16: origin is not finite"},
      {[](Bytes& b) { put(b, 48, HUGE_VAL); }, "16: origin is not finite"},
      {[](Bytes& b) { put(b, 56, 0.0); },
       "16: voxel size: expected a finite number above 0, got 0.000000"},
      {[](Bytes& b) { put(b, 72, -1.0); },
       "16: voxel size: expected a finite number above 0, got -1.000000"},
      {[](Bytes& b) { put(b, 64, HUGE_VAL); },
       "16: voxel size: expected a finite number above 0, got inf"},
      {[](Bytes& b) { put(b, 80, 0xffffffffu); }, "80: meta or directory is cut off"},
      {[](Bytes& b) { put(b, 84, 0xffffffffu); }, "80: meta or directory is cut off"},
      {[](Bytes& b) { put(b, 88, uint64_t{16}); }, "88: voxel count: expected 15, got 16"},
      {[](Bytes& b) { b[104] = 2; }, "104: codec of a stream: expected 0 or 1, got 2"},
      {[](Bytes& b) { b[106] = 9; }, "106: codec of a stream: expected 0 or 1, got 9"},
      {[](Bytes& b) { b[107] = 1; }, "107: codec of a stream: expected 0, got 1"},
      {[](Bytes& b) { b[111] = 1; }, "111: reserved byte: expected 0, got 1"},
      {[](Bytes& b) { b[127] = 9; }, "127: reserved byte: expected 0, got 9"},
      {[](Bytes& b) { b[128 + 15] = 1; }, "143: padding: expected 0, got 1"},
  });
}

TEST(GridFormat, every_field_of_the_directory_is_checked) {
  const std::string first = std::to_string(kDirectory), second = std::to_string(kDirectory + 48);
  const std::string data = std::to_string(kDirectory + 96);
  expect_refused({
      {[](Bytes& b) { put(b, kDirectory, 2); }, first + ": tile coord is outside the grid"},
      {[](Bytes& b) { put(b, kDirectory + 4, -1); }, first + ": tile coord is outside the grid"},
      {[](Bytes& b) { put(b, kDirectory, 1); },
       second + ": tiles are not in ascending Morton order"},
      {[](Bytes& b) { put(b, kDirectory + 12, 2u); },
       data + ": octree does not match its directory entry: expected 2 bricks and 6 voxels, "
              "got 1 and 6"},
      {[](Bytes& b) { put(b, kDirectory + 16, uint64_t{0}); },
       std::to_string(kDirectory + 16) + ": voxel count: expected 1 to 16777216, got 0"},
      {[](Bytes& b) { put(b, kDirectory + 16, uint64_t{1} << 40); },
       std::to_string(kDirectory + 16) +
           ": voxel count: expected 1 to 16777216, got 1099511627776"},
      {[](Bytes& b) {
         put(b, kDirectory + 16, uint64_t{7});
         put(b, kDirectory + 64, uint64_t{8});
       },
       data + ": octree does not match its directory entry: expected 1 bricks and 7 voxels, "
              "got 1 and 6"},
      {[](Bytes& b) { put(b, kDirectory + 24, uint64_t{0}); },
       std::to_string(kDirectory + 24) + ": tile offset: expected " + data + ", got 0"},
      {[](Bytes& b) { put(b, kDirectory + 32, 0u); },
       std::to_string(kDirectory + 32) + ": streams do not match the channels"},
      {[](Bytes& b) { put(b, kDirectory + 36, 0u); },
       std::to_string(kDirectory + 32) + ": streams do not match the channels"},
      {[](Bytes& b) { put(b, kDirectory + 40, 0xffffffffu); },
       std::to_string(kDirectory + 24) + ": tile data lie beyond the end"},
      {[](Bytes& b) { put(b, kDirectory + 44, 1u); },
       std::to_string(kDirectory + 44) + ": reserved bytes: expected 0, got others"},
  });
}

TEST(GridFormat, voxels_outside_dims_are_refused) {
  Bytes bytes = two_tiles();
  put(bytes, 16, 258);  // the box reaches to x = 258
  EXPECT_EQ(container_refusal(bytes), "grid container, byte 0: a tile has voxels outside dims");
  put(bytes, 16, 259);
  EXPECT_EQ(container_refusal(bytes), "");
}

TEST(GridFormat, attributes_of_another_length_than_the_voxels_need_are_refused) {
  Bytes bytes = two_tiles();
  // Colour and normal streams change places.
  const auto color = get<uint32_t>(bytes, kDirectory + 36);
  const auto normal = get<uint32_t>(bytes, kDirectory + 40);
  const size_t at = kDirectory + 96 + get<uint32_t>(bytes, kDirectory + 32);
  std::rotate(bytes.begin() + static_cast<std::ptrdiff_t>(at),
              bytes.begin() + static_cast<std::ptrdiff_t>(at + color),
              bytes.begin() + static_cast<std::ptrdiff_t>(at + color + normal));
  put(bytes, kDirectory + 36, normal);
  put(bytes, kDirectory + 40, color);
  EXPECT_EQ(container_refusal(bytes),
            "grid container, attributes: their bytes: expected 24, got 18");
}

TEST(GridFormat, a_flipped_byte_never_gives_more_than_a_refusal_or_another_grid) {
  const Bytes good = two_tiles();
  std::mt19937 random(4);
  for (size_t at = 0; at < good.size(); ++at) {
    Bytes bytes = good;
    bytes[at] = static_cast<uint8_t>(bytes[at] ^ (1 + test::below(random, 255)));
    const std::string text = container_refusal(bytes);
    EXPECT_TRUE(text.empty() || text.starts_with("grid container, ")) << text;
  }
}

TEST(GridWriter, writes_the_same_bytes_tile_by_tile) {
  std::mt19937 random(17);
  auto tiles = test::tiles_of(test::random_voxels(random, {700, 300, 520}, 4000), true, true);
  ASSERT_GT(tiles.size(), 4u);
  std::ranges::sort(tiles, {}, [](const SparseTile& tile) {
    return morton_encode(static_cast<uint32_t>(tile.coord[0]), static_cast<uint32_t>(tile.coord[1]),
                         static_cast<uint32_t>(tile.coord[2]));
  });
  GridHeader header = header_of({700, 300, 520}, true, true);
  header.meta_json = R"({"a":1})";
  const auto expected = encode_grid(header, tiles);
  ASSERT_TRUE(expected.ok());
  auto writer = GridWriter::open(header);
  ASSERT_TRUE(writer.ok());
  Bytes data;
  for (const SparseTile& tile : tiles) {
    const auto encoded = encode_tile(tile, writer->header());
    ASSERT_TRUE(encoded.ok());
    ASSERT_TRUE(writer->add(*encoded).ok());
    encoded->append_to(data);
  }
  EXPECT_EQ(writer->tile_count(), tiles.size());
  auto whole = writer->finish(header.meta_json);
  ASSERT_TRUE(whole.ok());
  whole->insert(whole->end(), data.begin(), data.end());
  EXPECT_TRUE(*whole == *expected);
}

TEST(GridWriter, takes_tiles_over_as_another_container_has_them) {
  std::mt19937 random(18);
  const auto tiles =
      test::tiles_of(test::random_voxels(random, {700, 300, 520}, 4000), true, false);
  for (const Codec codec : {Codec::kFast, Codec::kSmall}) {
    GridHeader header = header_of({700, 300, 520}, true, false);
    header.codecs.octree = codec;
    header.codecs.channels[0] = codec;
    header.meta_json = R"({"longer": "than a word"})";
    const auto container = encode_grid(header, tiles);
    ASSERT_TRUE(container.ok()) << container.error().message();
    const auto reader = GridReader::open(*container);
    ASSERT_TRUE(reader.ok());
    auto writer = GridWriter::open(reader->header());
    ASSERT_TRUE(writer.ok());
    Bytes data;
    for (size_t i = 0; i < reader->tile_count(); ++i) {
      const EncodedTile tile = encoded_tile(*container, *reader, i);
      ASSERT_TRUE(writer->add(tile).ok());
      tile.append_to(data);
    }
    auto whole = writer->finish(header.meta_json);
    ASSERT_TRUE(whole.ok());
    whole->insert(whole->end(), data.begin(), data.end());
    EXPECT_TRUE(*whole == *container);
  }
}

TEST(GridWriter, refuses_tiles_out_of_order_and_headers_that_no_container_can_have) {
  EXPECT_FALSE(GridWriter::open(header_of({0, 1, 1}, false, false)).ok());
  auto writer = GridWriter::open(header_of({600, 600, 600}, false, false));
  ASSERT_TRUE(writer.ok());
  EncodedTile tile;
  tile.coord = {1, 0, 0};
  EXPECT_TRUE(writer->add(tile).ok());
  EXPECT_EQ(writer->add(tile).error().message(), "grid container: two tiles have the same coord");
  tile.coord = {0, 0, 0};
  EXPECT_EQ(writer->add(tile).error().message(),
            "grid container: tiles are not in ascending Morton order");
}

TEST(GridFormat, tiles_that_break_the_rules_are_never_written) {
  const GridHeader header = header_of({300, 300, 300}, false, false);
  const SparseTile good = test::tiles_of({{{1, 2, 3}, {}, {}}}, false, false)[0];
  const std::string rules = "grid container: a tile breaks the rules of SparseTile";
  const auto refused = [&](const std::vector<SparseTile>& tiles) {
    const auto bytes = encode_grid(header, tiles);
    EXPECT_FALSE(bytes);
    return bytes ? Error{} : bytes.error();
  };
  const auto changed = [&](const std::function<void(SparseTile&)>& change) {
    std::vector<SparseTile> tiles = {good};
    change(tiles[0]);
    const Error error = refused(tiles);
    EXPECT_EQ(error.code, ErrorCode::kInternal);
    EXPECT_EQ(error.message(), rules);
  };
  changed([](SparseTile& t) { t.coord = {2, 0, 0}; });
  changed([](SparseTile& t) { t.coord = {0, -1, 0}; });
  changed([](SparseTile& t) { t.color = {1, 2, 3, 4}; });
  changed([](SparseTile& t) { t.masks.push_back(t.masks[0]); });
  changed([](SparseTile& t) { t.masks[0] = {}; });
  changed([](SparseTile& t) { t.brick_morton[0] = 32768; });
  changed([](SparseTile& t) {
    t.masks.push_back(t.masks[0]);
    t.brick_morton.push_back(t.brick_morton[0]);
  });
  changed([](SparseTile& t) { t.coord = {1, 1, 1}, t.brick_morton[0] = 32767; });
  changed([](SparseTile& t) { t.full = {{1, 1}}; });           // not aligned
  changed([](SparseTile& t) { t.full = {{0, 0}}; });           // overlaps the brick
  changed([](SparseTile& t) { t.full = {{8, 1}, {8, 0}}; });   // overlap each other
  changed([](SparseTile& t) { t.full = {{16, 0}, {8, 0}}; });  // not ascending
  changed([](SparseTile& t) { t.full = {{32768, 0}}; });       // outside the tile
  changed([](SparseTile& t) { t.full = {{8, 6}}; });           // larger than the tile
  changed([](SparseTile& t) { t.coord = {1, 1, 1}, t.full = {{4096, 4}}; });  // outside dims
  EXPECT_EQ(refused({good, good}).message(), "grid container: two tiles have the same coord");
}

TEST(GridFormat, headers_that_break_the_rules_are_never_written) {
  GridHeader header = header_of({0, 1, 1}, false, false);
  EXPECT_EQ(encode_grid(header, {}).error().message(),
            "grid container, byte 16: dims: expected 1 to 16384, got 0");
  EXPECT_EQ(encode_grid(header, {}).error().code, ErrorCode::kInternal);
  header = header_of({1, 1, 1}, false, false);
  header.meta_json.resize((size_t{1} << 24) + 1, ' ');
  EXPECT_EQ(encode_grid(header, {}).error().message(),
            "grid container: meta: expected at most 16777216 bytes, got 16777217");
}

TEST(GridFormat, streams_are_given_as_they_are_stored) {
  std::mt19937 random(11);
  GridHeader header;
  header.dims = {600, 300, 300};
  header.voxel_size = {1, 1, 1};
  header.channels = {.color = true, .label = true};
  header.meta_json = R"({"units":"mm"})";
  auto tiles = test::tiles_of(test::random_voxels(random, header.dims, 2000), header.channels);
  SparseTile whole;
  whole.coord = {1, 0, 0};
  whole.full = {{0, kTileLevels}};
  std::erase_if(tiles, [](const SparseTile& tile) { return tile.coord[0] == 1; });
  tiles.push_back(whole);
  const auto container = encode_grid(header, tiles);
  ASSERT_TRUE(container) << container.error().message();
  const auto reader = GridReader::open(*container);
  ASSERT_TRUE(reader);
  ASSERT_GT(reader->tile_count(), 2U);
  for (size_t i = 0; i < reader->tile_count(); ++i) {
    const StoredTile stored = stored_tile(*container, *reader, i);
    const auto encoded = encode_tile(reader->decode_tile(i).value(), header);
    ASSERT_TRUE(encoded);
    EXPECT_EQ(stored.coord, encoded->coord);
    EXPECT_EQ(stored.brick_count, encoded->bricks);
    EXPECT_EQ(stored.voxel_count, encoded->voxels);
    EXPECT_TRUE(std::ranges::equal(stored.streams[0], encoded->octree));
    for (size_t c = 0; c < kChannelCount; ++c) {
      EXPECT_TRUE(std::ranges::equal(stored.streams[1 + c], encoded->channels[c])) << c;
    }
  }
}

}  // namespace
}  // namespace voxeld
