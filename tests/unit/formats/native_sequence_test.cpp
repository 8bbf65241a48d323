// Sequences whose streams come from containers of grids.
#include "server/formats/native_sequence.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "proto/container/grid_streams.h"
#include "server/base/disk/file.h"
#include "server/formats/formats.h"
#include "server/grid/content_hash.h"
#include "tests/unit/formats/sample_frames.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

constexpr ChannelSet kColorOnly = {.color = true};
using Bytes = std::vector<uint8_t>;

Bytes container_of(const Grid& grid, Codec codec = Codec::kFast) {
  OutputOptions options;
  options.codec = codec;
  auto bytes = encode(grid, options);
  EXPECT_TRUE(bytes.ok()) << bytes.error().message();
  return bytes ? *std::move(bytes) : Bytes();
}

std::vector<StoredTile> stored_tiles(const Bytes& container) {
  const auto reader = GridReader::open(container);
  EXPECT_TRUE(reader.ok()) << reader.error().message();
  std::vector<StoredTile> tiles;
  for (size_t i = 0; i < reader->tile_count(); ++i) {
    tiles.push_back(stored_tile(container, *reader, i));
  }
  return tiles;
}

// As test::sequence_bytes(), by the streams of the frames' containers, `part` tiles at a time.
Bytes taken_over(const std::vector<Grid>& grids, size_t part = SIZE_MAX,
                 const SequenceWriterOptions& options = {}) {
  auto writer = SequenceWriter::open(container_header(grids.front()), 24, options);
  EXPECT_TRUE(writer.ok());
  Bytes out = writer->front();
  for (size_t i = 0; i < grids.size(); ++i) {
    EXPECT_TRUE(writer->begin_frame(static_cast<double>(i) / 24));
    const Bytes container = container_of(grids[i]);
    const auto tiles = stored_tiles(container);
    for (std::span<const StoredTile> rest = tiles; !rest.empty();) {
      const size_t count = std::min(part, rest.size());
      const auto bytes = writer->add_stored(rest.first(count));
      EXPECT_TRUE(bytes.ok()) << bytes.error().message();
      if (!bytes) return {};
      out.insert(out.end(), bytes->begin(), bytes->end());
      rest = rest.subspan(count);
    }
    writer->end_frame();
  }
  const auto end = writer->finish();
  EXPECT_TRUE(end.ok());
  out.insert(out.end(), end->index.begin(), end->index.end());
  std::copy(end->header.begin(), end->header.end(), out.begin());
  return out;
}

Bytes from_tiles(const std::vector<Grid>& grids) {
  return test::sequence_bytes(grids).value();
}

TEST(StoredStreams, give_the_bytes_that_tiles_give) {
  for (uint32_t bits = 0; bits < test::kChannelSets; bits += 7) {
    SCOPED_TRACE(bits);
    auto grids = test::mostly_static(bits + 1, {300, 40, 530}, 900, 6, channels_of_bits(bits), 20);
    grids[1].tiles.erase(grids[1].tiles.begin());
    grids[3].tiles.clear();
    grids[4].tiles.pop_back();
    grids.push_back(grids[2]);
    EXPECT_EQ(taken_over(grids), from_tiles(grids));
  }
}

TEST(StoredStreams, of_full_nodes_are_the_same_too) {
  std::vector<Grid> grids = {test::grid_with_a_full_brick(true, false),
                             test::grid_with_a_full_brick(true, false)};
  grids[1].tiles[0].full.clear();
  Grid only_full = grids[0];
  only_full.tiles[0] = {};
  only_full.tiles[0].full = {{morton_encode(1, 1, 1), 0}};
  grids.push_back(only_full);
  EXPECT_EQ(taken_over(grids), from_tiles(grids));
}

TEST(StoredStreams, of_frames_in_parts_are_the_same_too) {
  const auto grids = test::mostly_static(5, {700, 300, 530}, 4000, 5, kColorOnly, 20);
  ASSERT_GT(grids[0].tiles.size(), 5U);
  EXPECT_EQ(taken_over(grids, 1), from_tiles(grids));
  EXPECT_EQ(taken_over(grids, 4), from_tiles(grids));
}

TEST(StoredStreams, every_frame_is_read_alone_from_at_most_eight) {
  const auto grids = test::mostly_static(9, {120, 120, 120}, 4000, 20, kColorOnly);
  const Bytes bytes = taken_over(grids);
  const auto reader = SequenceReader::open(bytes);
  ASSERT_TRUE(reader.ok());
  uint32_t longest = 0;
  for (size_t i = 0; i < reader->stream_count(); ++i) {
    longest = std::max(longest, reader->chain_length(i));
  }
  EXPECT_EQ(longest, kStreamChainMax);
  for (const size_t frame : {19, 0, 8, 7, 15, 16}) {
    Grid back = grids[frame];
    back.tiles = reader->decode_frame(frame).value();
    EXPECT_EQ(content_hash(back), content_hash(grids[frame]));
  }
}

TEST(StoredStreams, that_stand_for_themselves_are_those_of_the_container) {
  const Grid grid = test::random_grid(3, {300, 40, 270}, 900, true, true);
  const Bytes container = container_of(grid), bytes = taken_over({grid});
  const auto reader = GridReader::open(container).value();
  const auto begin = static_cast<std::ptrdiff_t>(reader.tile_byte_range(0).first);
  EXPECT_NE(std::search(bytes.begin(), bytes.end(), container.begin() + begin, container.end()),
            bytes.end());
}

// The result of add_stored() for a tile changed by `change`.
template <typename Change>
std::string refusal_of(Change change) {
  const Grid grid =
      test::grid_of({64, 64, 64}, {{.cell = {1, 2, 3}}, {.cell = {40, 2, 3}}}, kColorOnly);
  const Bytes container = container_of(grid);
  std::vector<StoredTile> tiles = stored_tiles(container);
  change(tiles.front());
  SequenceWriter writer = SequenceWriter::open(container_header(grid), 24).value();
  EXPECT_TRUE(writer.begin_frame(0));
  const auto bytes = writer.add_stored(tiles);
  return bytes ? "" : bytes.error().message();
}

TEST(StoredStreams, that_disagree_with_their_tile_are_refused) {
  EXPECT_EQ(refusal_of([](StoredTile&) {}), "");
  const std::string octree = "grid container, octree does not match its directory entry: expected ";
  EXPECT_EQ(refusal_of([](StoredTile& tile) { tile.brick_count = 3; }),
            octree + "3 bricks and 2 voxels, got 2 bricks and 2 voxels");
  EXPECT_EQ(refusal_of([](StoredTile& tile) { tile.voxel_count = 9; }),
            octree + "2 bricks and 9 voxels, got 2 bricks and 2 voxels");
  EXPECT_EQ(refusal_of([](StoredTile& tile) { tile.streams[1] = {}; }),
            "sequence container: streams of other channels");
  EXPECT_EQ(refusal_of([](StoredTile& tile) { tile.streams[2] = tile.streams[1]; }),
            "sequence container: streams of other channels");
  EXPECT_EQ(refusal_of([](StoredTile& tile) { tile.coord[0] = 1; }),
            "sequence container: a tile lies outside");
  EXPECT_NE(refusal_of([](StoredTile& tile) { std::swap(tile.streams[0], tile.streams[1]); }), "");
  EXPECT_NE(refusal_of([](StoredTile& tile) { tile.streams[1] = tile.streams[0]; }), "");
  EXPECT_NE(refusal_of([](StoredTile& tile) {
              tile.streams[1] = tile.streams[1].first(tile.streams[1].size() - 1);
            }),
            "");
}

TEST(StoredStreams, are_of_codec_fast) {
  const Grid grid = test::random_grid(3, {30, 40, 27}, 90, true, false);
  GridHeader header = container_header(grid);
  header.codecs.channels[0] = Codec::kSmall;
  SequenceWriter writer = SequenceWriter::open(header, 24).value();
  ASSERT_TRUE(writer.begin_frame(0));
  EXPECT_EQ(writer.add_stored({}).error().message(),
            "sequence container: streams are taken over as fast");
}

// Frames in files, as a task has them.
class NativeSequenceTest : public testing::Test, public FrameSource {
 protected:
  NativeSequenceTest()
      : folder_(fs::temp_directory_path() /
                ("unit_formats-native-sequence-" + std::to_string(getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~NativeSequenceTest() override { fs::remove_all(folder_); }

  void set_frames(std::vector<Grid> grids, Codec codec = Codec::kFast) {
    grids_ = std::move(grids);
    common_ = grids_.front();
    common_.tiles.clear();
    for (size_t i = 0; i < grids_.size(); ++i) {
      ASSERT_TRUE(write_file(*container(i), container_of(grids_[i], codec)));
    }
  }
  Status write(Codec codec = Codec::kFast) {
    OutputOptions options;
    options.codec = codec;
    return write_sequence(*this, options, path());
  }
  fs::path path() const { return folder_ / "sequence"; }

  const Grid& common() const override { return common_; }
  size_t frame_count() const override { return grids_.size(); }
  double time_s(size_t index) const override { return static_cast<double>(index) / 24; }
  double fps() const override { return 24; }
  Result<Grid> frame(size_t) const override {
    return Error{ErrorCode::kInternal, "a frame that has a container is not asked for", "", ""};
  }
  std::optional<fs::path> container(size_t index) const override {
    return folder_ / std::to_string(index);
  }
  Status before_tiles(size_t done, size_t total) const override {
    reads_.push_back({done, total});
    if (reads_.size() < reads_max_) return {};
    return Error{ErrorCode::kCancelled, "the job was cancelled", "", ""};
  }

  fs::path folder_;
  std::vector<Grid> grids_;
  Grid common_;
  mutable std::vector<std::pair<size_t, size_t>> reads_;
  size_t reads_max_ = SIZE_MAX;
};

TEST_F(NativeSequenceTest, of_containers_is_that_of_their_grids) {
  set_frames(test::mostly_static(7, {300, 40, 530}, 900, 5, kColorOnly, 20));
  ASSERT_TRUE(write());
  EXPECT_EQ(read_file(path()).value(), from_tiles(grids_));
  EXPECT_EQ(reads_.size(), 5U);
}

TEST_F(NativeSequenceTest, of_another_codec_is_made_from_decoded_tiles) {
  const auto grids = test::mostly_static(7, {300, 40, 30}, 600, 3, kColorOnly, 20);
  set_frames(grids);
  ASSERT_TRUE(write(Codec::kSmall));
  EXPECT_EQ(read_file(path()).value(),
            test::sequence_bytes(grids, StreamCodecs::all(Codec::kSmall)).value());
  set_frames(grids, Codec::kSmall);
  ASSERT_TRUE(write());
  EXPECT_EQ(read_file(path()).value(), from_tiles(grids));
}

TEST_F(NativeSequenceTest, of_many_tiles_is_made_in_batches) {
  Grid grid = test::grid_of({256 * 9, 256, 256}, {}, ChannelSet());
  for (int32_t x = 0; x < 9; ++x) {
    SparseTile& tile = grid.tiles.emplace_back();
    tile.coord = {x, 0, 0};
    tile.full = {{0, kTileLevels}};
  }
  set_frames({grid, grid});
  ASSERT_TRUE(write());
  EXPECT_EQ(read_file(path()).value(), from_tiles(grids_));
  const std::vector<std::pair<size_t, size_t>> frame = {{0, 9}, {4, 9}, {8, 9}};
  ASSERT_EQ(reads_.size(), 6U);
  EXPECT_TRUE(std::equal(frame.begin(), frame.end(), reads_.begin()));
  EXPECT_TRUE(std::equal(frame.begin(), frame.end(), reads_.begin() + 3));
}

TEST_F(NativeSequenceTest, that_is_cancelled_leaves_no_file) {
  set_frames(test::mostly_static(7, {30, 40, 30}, 300, 4, kColorOnly, 20));
  reads_max_ = 3;
  const Status status = write();
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().message(), "the job was cancelled");
  EXPECT_FALSE(fs::exists(path()));
}

// Every byte after the meta is a number that is checked, or of a stream with a checksum.
TEST_F(NativeSequenceTest, of_a_broken_container_names_the_frame_and_leaves_no_file) {
  set_frames(test::mostly_static(7, {64, 64, 64}, 600, 2, kColorOnly, 20));
  ASSERT_TRUE(write());
  const Bytes whole = read_file(path()).value();
  const Bytes good = container_of(grids_[1]);
  const size_t meta_end = kGridHeaderBytes + 16;
  size_t refused = 0;
  for (size_t at = meta_end; at < good.size(); at += 1 + at % 17) {
    Bytes changed = good;
    changed[at] ^= 0x10;
    ASSERT_TRUE(write_file(*container(1), changed));
    if (const Status status = write(); status) {
      EXPECT_EQ(read_file(path()).value().size(), whole.size()) << at;
    } else {
      const std::string message = status.error().message();
      EXPECT_TRUE(message.starts_with("frame 1: ")) << message;
      EXPECT_FALSE(fs::exists(path())) << at;
      ++refused;
    }
  }
  EXPECT_GT(refused, 100U);
  fs::remove(*container(1));
  EXPECT_EQ(write().error().message(), "frame 1: open 1: No such file or directory");
}

TEST_F(NativeSequenceTest, of_containers_of_another_place_is_refused) {
  set_frames(test::mostly_static(7, {64, 64, 64}, 600, 2, kColorOnly, 20));
  const Grid other = test::random_grid(3, {64, 64, 65}, 90, true, false);
  ASSERT_TRUE(write_file(*container(1), container_of(other)));
  EXPECT_EQ(write().error().message(),
            "frame 1: the container of another place, or with other channels");
}

}  // namespace
}  // namespace voxeld
