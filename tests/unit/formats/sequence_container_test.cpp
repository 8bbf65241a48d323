#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <numeric>

#include "proto/container/grid_format.h"
#include "tests/unit/formats/sample_frames.h"

namespace voxeld {
namespace {

constexpr ChannelSet kColor = {.color = true};
constexpr ChannelSet kEverything = channels_of_bits(test::kChannelSets - 1);

std::vector<uint8_t> written(const std::vector<Grid>& grids, const StreamCodecs& codecs = {},
                             const SequenceWriterOptions& options = {}) {
  auto bytes = test::sequence_bytes(grids, codecs, options);
  EXPECT_TRUE(bytes.ok()) << bytes.error().message();
  return bytes ? *std::move(bytes) : std::vector<uint8_t>();
}

SequenceReader opened(const std::vector<uint8_t>& bytes) {
  auto reader = SequenceReader::open(bytes);
  EXPECT_TRUE(reader.ok()) << reader.error().message();
  return *std::move(reader);
}

// Reads frames in the order given, each alone.
void expect_frames(const SequenceReader& reader, const std::vector<Grid>& grids,
                   const std::vector<size_t>& order, RawStreams* kept = nullptr) {
  ASSERT_EQ(reader.frame_count(), grids.size());
  for (const size_t frame : order) {
    SCOPED_TRACE(frame);
    const auto tiles = reader.decode_frame(frame, kept);
    ASSERT_TRUE(tiles.ok()) << tiles.error().message();
    EXPECT_EQ(*tiles, grids[frame].tiles);
    EXPECT_EQ(reader.voxel_count(frame), grids[frame].voxel_count());
    EXPECT_EQ(reader.tile_count(frame), grids[frame].tiles.size());
    EXPECT_EQ(reader.time_s(frame), static_cast<double>(frame) / 24);
  }
}

std::vector<size_t> in_order(size_t count) {
  std::vector<size_t> order(count);
  std::iota(order.begin(), order.end(), size_t{0});
  return order;
}

uint32_t longest_chain(const SequenceReader& reader) {
  uint32_t longest = 0;
  for (size_t i = 0; i < reader.stream_count(); ++i) {
    longest = std::max(longest, reader.chain_length(i));
  }
  return longest;
}

template <typename T>
void put(std::vector<uint8_t>& bytes, size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}
template <typename T>
T get(const std::vector<uint8_t>& bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

TEST(SequenceContainer, frames_come_back_with_every_set_of_channels) {
  for (uint32_t bits = 0; bits < test::kChannelSets; bits += 7) {
    SCOPED_TRACE(bits);
    const auto grids =
        test::mostly_static(bits + 1, {300, 40, 270}, 600, 5, channels_of_bits(bits), 20);
    const auto bytes = written(grids);
    const SequenceReader reader = opened(bytes);
    EXPECT_EQ(reader.header().channels, grids[0].channels);
    expect_frames(reader, grids, in_order(5));
  }
}

TEST(SequenceContainer, place_rate_and_meta_come_back) {
  const auto bytes = written({test::random_grid(3, {20, 30, 40}, 50, true, false)});
  const SequenceReader reader = opened(bytes);
  EXPECT_EQ(reader.header().dims, (std::array<int32_t, 3>{20, 30, 40}));
  EXPECT_EQ(reader.header().origin, (std::array<double, 3>{-1.5, 0.25, 1e10}));
  EXPECT_EQ(reader.header().voxel_size, (std::array<double, 3>{0.5, 0.25, 0.125}));
  EXPECT_EQ(reader.header().meta_json, R"({"units":"mm"})");
  EXPECT_EQ(reader.fps(), 24);
}

TEST(SequenceContainer, codec_small_and_codecs_of_both_kinds_come_back) {
  const auto grids = test::mostly_static(5, {60, 300, 60}, 900, 4, kEverything, 20);
  for (StreamCodecs codecs : {StreamCodecs::all(Codec::kSmall), StreamCodecs{Codec::kSmall, {}}}) {
    const auto bytes = written(grids, codecs);
    const SequenceReader reader = opened(bytes);
    EXPECT_EQ(reader.header().codecs, codecs);
    expect_frames(reader, grids, in_order(4));
  }
  const auto octree_fast = [] {
    StreamCodecs codecs = StreamCodecs::all(Codec::kSmall);
    codecs.octree = Codec::kFast;
    return codecs;
  }();
  const auto bytes = written(grids, octree_fast);
  expect_frames(opened(bytes), grids, {3, 0, 2, 1});
}

TEST(SequenceContainer, any_frame_is_read_alone_and_no_chain_is_longer_than_it_may_be) {
  const auto grids = test::mostly_static(9, {120, 120, 120}, 4000, 30, kColor);
  const auto bytes = written(grids);
  const SequenceReader reader = opened(bytes);
  EXPECT_EQ(longest_chain(reader), kStreamChainMax);
  expect_frames(reader, grids, {29, 7, 8, 0, 15, 16, 22});
}

TEST(SequenceContainer, frames_read_in_order_may_keep_what_they_read) {
  const auto grids = test::mostly_static(9, {120, 120, 120}, 4000, 20, kColor);
  const auto bytes = written(grids);
  RawStreams kept;
  expect_frames(opened(bytes), grids, in_order(20), &kept);
  EXPECT_EQ(kept.size(), 2U);  // of the last frame alone
  expect_frames(opened(bytes), grids, {3, 19, 0}, &kept);
}

TEST(SequenceContainer, differences_of_a_scene_that_mostly_stands_still_are_smaller) {
  const auto grids = test::mostly_static(11, {200, 200, 200}, 20000, 24, kColor);
  const size_t whole = written(grids, {}, {.chain_max = 1}).size();
  const size_t difference = written(grids).size();
  EXPECT_LT(3 * difference, whole);
  // If a chain ends, its first stream goes on: a second one is not written.
  const auto bytes = written(grids);
  const SequenceReader reader = opened(bytes);
  size_t plain = 0;
  for (size_t i = 0; i < reader.stream_count(); ++i) plain += reader.chain_length(i) == 1 ? 1U : 0U;
  EXPECT_EQ(plain, 2U);
}

TEST(SequenceContainer, differences_that_do_not_win_are_tried_again_within_four_frames) {
  std::vector<Grid> grids;
  for (uint32_t seed = 0; seed < 9; ++seed) {
    grids.push_back(test::random_grid(seed, {90, 90, 90}, 3000, true, false));
  }
  for (Grid& grid : test::mostly_static(13, {90, 90, 90}, 3000, 6, kColor)) {
    grids.push_back(std::move(grid));
  }
  const auto bytes = written(grids);
  const SequenceReader reader = opened(bytes);
  ASSERT_EQ(reader.stream_count(), 2 * grids.size());
  for (size_t stream = 0; stream < 2 * 9; ++stream) EXPECT_EQ(reader.chain_length(stream), 1U);
  for (size_t frame = 9 + 4; frame < grids.size(); ++frame) {
    EXPECT_GT(reader.chain_length(2 * frame), 1U) << frame;
    EXPECT_GT(reader.chain_length(2 * frame + 1), 1U) << frame;
  }
  expect_frames(reader, grids, {14, 13, 8, 0});
}

TEST(SequenceContainer, equal_frames_and_equal_streams_are_stored_once) {
  const auto grids = test::mostly_static(13, {90, 90, 90}, 3000, 3, kColor);
  std::vector<Grid> loop = {grids[0], grids[1], grids[2], grids[1], grids[0], grids[0]};
  const auto bytes = written(loop);
  const SequenceReader reader = opened(bytes);
  EXPECT_EQ(bytes.size(), written(grids).size() + 3 * 24);  // three entries of frames
  EXPECT_TRUE(reader.same_tiles(0, 5));
  EXPECT_TRUE(reader.same_tiles(1, 3));
  EXPECT_FALSE(reader.same_tiles(0, 1));
  expect_frames(reader, loop, {5, 3, 0, 4, 1, 2});

  // Other colours, the same octree: one more stream.
  Grid painted = grids[0];
  for (uint8_t& sample : painted.tiles[0].color) sample ^= 0x55;
  const std::vector<Grid> two = {grids[0], painted};
  const auto painted_bytes = written(two);
  EXPECT_EQ(opened(painted_bytes).stream_count(), 3U);
  expect_frames(opened(painted_bytes), two, {1, 0});
}

TEST(SequenceContainer, equal_ids_of_other_voxels_are_stored_once_by_codec_fast_alone) {
  // Two voxels with the same labels, elsewhere.
  const ChannelSet labels = {.label = true};
  const auto at = [&](int x) {
    return test::grid_of(
        {64, 8, 8}, {{.cell = {x, 0, 0}, .label = 7}, {.cell = {x + 1, 0, 0}, .label = 9}}, labels);
  };
  const std::vector<Grid> grids = {at(0), at(40)};
  EXPECT_EQ(opened(written(grids)).stream_count(), 3U);
  const auto small = written(grids, StreamCodecs::all(Codec::kSmall));
  EXPECT_EQ(opened(small).stream_count(), 4U);
  expect_frames(opened(small), grids, {0, 1});
}

TEST(SequenceContainer, empty_frames_and_tiles_that_come_and_go) {
  const std::array<int, 3> dims = {600, 20, 20};
  const auto one = [&](std::vector<test::TestVoxel> voxels) {
    return test::grid_of(dims, voxels, kColor);
  };
  const std::vector<Grid> grids = {
      one({}), one({{.cell = {5, 1, 1}}, {.cell = {300, 1, 1}}}),   one({{.cell = {300, 1, 1}}}),
      one({}), one({{.cell = {599, 19, 19}}, {.cell = {5, 1, 1}}}), one({})};
  const auto bytes = written(grids);
  expect_frames(opened(bytes), grids, in_order(6));
}

TEST(SequenceContainer, full_nodes_come_back) {
  std::vector<Grid> grids = {test::grid_with_a_full_brick(true, false),
                             test::grid_with_a_full_brick(true, false)};
  grids[1].tiles[0].full.clear();
  Grid only_full = grids[0];
  only_full.tiles[0] = {};
  only_full.tiles[0].full = {{morton_encode(1, 1, 1), 0}};
  grids.push_back(only_full);
  const auto bytes = written(grids);
  expect_frames(opened(bytes), grids, in_order(3));
}

TEST(SequenceContainer, bytes_do_not_depend_on_the_run) {
  const auto grids = test::mostly_static(17, {400, 60, 300}, 3000, 6, kEverything);
  EXPECT_EQ(written(grids), written(grids));
}

TEST(SequenceContainer, contents_beyond_what_may_be_kept_are_written_whole) {
  const auto grids = test::mostly_static(11, {200, 200, 200}, 20000, 4, kColor);
  const SequenceWriterOptions none = {.kept_bytes_max = 0};
  EXPECT_EQ(written(grids, {}, none), written(grids, {}, {.chain_max = 1}));
}

TEST(SequenceContainer, a_writer_refuses_what_no_container_has) {
  const Grid grid = test::random_grid(3, {20, 30, 40}, 50, true, false);
  auto writer = SequenceWriter::open(container_header(grid), 24);
  ASSERT_TRUE(writer.ok());
  EXPECT_EQ(writer->finish().error().message(), "sequence container: no frame");
  ASSERT_TRUE(writer->add(1, grid.tiles).ok());
  EXPECT_EQ(writer->add(0.5, grid.tiles).error().message(), "sequence container: times go back");
  std::vector<SparseTile> twice = {grid.tiles[0], grid.tiles[0]};
  EXPECT_EQ(writer->add(1, twice).error().message(),
            "sequence container: tiles are not in ascending Morton order");
  twice[0].color.pop_back();
  twice.pop_back();
  EXPECT_EQ(writer->add(1, twice).error().code, ErrorCode::kInternal);
  EXPECT_FALSE(SequenceWriter::open(container_header(grid), 24, {.chain_max = 9}).ok());
}

// A container of two frames of one tile with colour, the second one's octree a difference. Its
// index: frames at 0 and 24, tiles at 48 and 80, streams at 112, 128, 144 and 160.
struct Sample {
  std::vector<Grid> grids = test::mostly_static(19, {64, 64, 64}, 3000, 2, kColor);
  std::vector<uint8_t> bytes = written(grids);
  size_t index = 0, meta_end = 0;

  Sample() {
    index = get<uint64_t>(bytes, 112);
    meta_end = 128 + 16;
  }
};

std::string refusal(const std::vector<uint8_t>& bytes) {
  const auto reader = SequenceReader::open(bytes);
  if (!reader) {
    EXPECT_EQ(reader.error().code, ErrorCode::kBadRequest);
    return reader.error().message();
  }
  for (size_t i = 0; i < reader->frame_count(); ++i) {
    const auto tiles = reader->decode_frame(i);
    if (!tiles) return tiles.error().message();
  }
  return "";
}

template <typename T>
std::string refusal_with(size_t at, T value) {
  Sample sample;
  put(sample.bytes, at, value);
  return refusal(sample.bytes);
}

std::string in_index(const Sample& sample, size_t at) {
  return "sequence container, byte " + std::to_string(sample.index + at) + ": ";
}

TEST(SequenceContainer, headers_that_lie_are_refused_by_name) {
  const std::string byte = "sequence container, byte ";
  EXPECT_EQ(refusal({}), byte + "0: the header is cut off: expected 128 bytes, got 0");
  EXPECT_EQ(refusal_with<uint8_t>(0, 'W'),
            byte + "0: not a sequence container: expected the magic VOXSEQ, got other bytes");
  EXPECT_EQ(refusal_with<uint32_t>(8, 2), byte + "8: version: expected 1, got 2");
  EXPECT_EQ(refusal_with<uint32_t>(12, 64), byte + "12: unknown channels");
  EXPECT_EQ(refusal_with<int32_t>(16, 0), byte + "16: dims: expected 1 to 16384, got 0");
  EXPECT_EQ(refusal_with<uint32_t>(28, 7), byte + "28: tile side: expected 8, got another");
  EXPECT_EQ(refusal_with<uint32_t>(80, 0), byte + "80: frame count: expected 1 to 4096, got 0");
  EXPECT_EQ(refusal_with<uint32_t>(84, 1u << 30), byte + "84: meta is cut off");
  EXPECT_EQ(refusal_with<double>(88, -1),
            byte + "88: frames per second: expected a finite number, 0 or more, got -1.000000");
  EXPECT_EQ(refusal_with<uint8_t>(104, 2), byte + "104: codec of a stream: expected 0 or 1, got 2");
  EXPECT_EQ(refusal_with<uint8_t>(106, 1), byte + "106: codec of a stream: expected 0, got 1");
  EXPECT_EQ(refusal_with<uint8_t>(111, 1), byte + "111: reserved byte: expected 0, got another");
  EXPECT_EQ(refusal_with<uint8_t>(143, 1), byte + "143: padding: expected 0, got 1");
  EXPECT_NE(refusal_with<uint64_t>(112, 4).find("112: offset of the index"), std::string::npos);
  EXPECT_NE(refusal_with<uint32_t>(120, 3).find("bytes of the index"), std::string::npos);
  EXPECT_NE(refusal_with<uint32_t>(124, 0xffffffff).find("bytes of the index"), std::string::npos);
}

TEST(SequenceContainer, indexes_that_lie_are_refused_by_name) {
  const Sample sample;
  ASSERT_EQ(get<uint32_t>(sample.bytes, 120), 2U);
  ASSERT_EQ(get<uint32_t>(sample.bytes, 124), 4U);
  ASSERT_EQ(get<uint32_t>(sample.bytes, sample.index + 144 + 12), 0U);  // a difference
  const auto at = [&](size_t offset) { return sample.index + offset; };
  const auto says = [&](size_t offset, const std::string& what) {
    return in_index(sample, offset) + what;
  };
  EXPECT_EQ(refusal_with<double>(at(24), -1), says(24,
                                                   "time of a frame: expected a finite number, "
                                                   "none before the last frame's, "
                                                   "got -1.000000"));
  EXPECT_EQ(refusal_with<uint64_t>(at(8), 1).substr(0, says(8, "voxel count").size()),
            says(8, "voxel count"));
  EXPECT_EQ(refusal_with<uint32_t>(at(16), 1),
            says(16, "tiles of a frame: expected from number 0 on, got 1 from number 1"));
  EXPECT_EQ(refusal_with<uint32_t>(at(40), 0),
            says(32, "a frame differs from the one whose tiles it has"));
  EXPECT_EQ(refusal_with<uint32_t>(at(44), 2),
            says(40, "tiles of a frame: expected from number 1 on, got 2 from number 1"));
  EXPECT_EQ(refusal_with<int32_t>(at(48), 1), says(48, "tile coord is outside the grid"));
  EXPECT_EQ(refusal_with<uint32_t>(at(60), 40000),
            says(60, "brick count: expected 0 to 32768, got 40000"));
  EXPECT_EQ(refusal_with<uint64_t>(at(64), 0),
            says(64, "voxel count: expected 1 to 16777216, got 0"));
  EXPECT_EQ(refusal_with<uint32_t>(at(72), 1),
            says(72, "number of a stream: expected at most 0, got 1"));
  EXPECT_EQ(refusal_with<uint32_t>(at(108), 2), says(108, "a tile has a stream of another kind"));
  EXPECT_EQ(refusal_with<uint32_t>(at(104), 0),
            says(108, "number of a stream: expected at most 2, got 3"));
  EXPECT_EQ(refusal_with<uint64_t>(at(112), 0),
            says(112, "offset of a stream: expected 144, got 0"));
  EXPECT_EQ(refusal_with<uint32_t>(at(120), 0),
            says(120, "bytes of a stream: expected 1 or more, got 0"));
  EXPECT_EQ(refusal_with<uint32_t>(at(168), 0xfffffffe),
            says(160, "a stream lies beyond the index"));
  const std::string base =
      "what a stream is a difference to: expected an earlier one of its kind "
      "and of codec fast, got ";
  EXPECT_EQ(refusal_with<uint32_t>(at(156), 2), says(156, base + "2"));  // itself
  EXPECT_EQ(refusal_with<uint32_t>(at(156), 3), says(156, base + "3"));
  EXPECT_EQ(refusal_with<uint32_t>(at(156), 1), says(156, base + "1"));  // another kind
  EXPECT_EQ(refusal_with<uint32_t>(at(124), 0), says(124, base + "0"));
}

TEST(SequenceContainer, chains_that_are_too_long_are_refused) {
  auto bytes = written(test::mostly_static(9, {60, 60, 60}, 4000, 10, ChannelSet()));
  const SequenceReader reader = opened(bytes);
  ASSERT_EQ(reader.chain_length(7), 8U);
  ASSERT_EQ(reader.chain_length(8), 2U);
  const size_t streams = bytes.size() - size_t{16} * reader.stream_count();
  put<uint32_t>(bytes, streams + 8 * 16 + 12, 7);
  EXPECT_EQ(refusal(bytes), "sequence container, byte " + std::to_string(streams + 8 * 16 + 12) +
                                ": streams that are read for one: expected at most 8, got 9");
}

TEST(SequenceContainer, every_truncation_is_refused) {
  const Sample sample;
  for (size_t size = 0; size < sample.bytes.size(); size += 1 + size / 40) {
    const std::vector<uint8_t> cut(sample.bytes.begin(),
                                   sample.bytes.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_NE(refusal(cut), "") << size;
  }
}

// Every stream has a checksum: where a bit of it means nothing, the frames are the same.
TEST(SequenceContainer, changed_bytes_are_refused_or_change_nothing) {
  const Sample sample;
  size_t refused = 0;
  for (size_t at = sample.meta_end; at < sample.index; at += 1 + at % 13) {
    std::vector<uint8_t> changed = sample.bytes;
    changed[at] ^= 0x10;
    const std::string message = refusal(changed);
    if (message.empty()) {
      expect_frames(opened(changed), sample.grids, {0, 1});
    } else {
      EXPECT_TRUE(message.starts_with("sequence container, byte ")) << message;
      ++refused;
    }
  }
  EXPECT_GT(refused, 200U);
  for (size_t at = sample.index; at < sample.bytes.size(); ++at) {
    const size_t entry = at - sample.index;
    if (entry < 48 && entry % 24 < 8) continue;  // a time
    std::vector<uint8_t> changed = sample.bytes;
    changed[at] ^= 0x01;
    EXPECT_NE(refusal(changed), "") << entry;
  }
}

}  // namespace
}  // namespace voxeld
