// The decoded sequence against what was written into its container.
#include "client/include/voxeld/client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "tests/unit/client/client_test_tools.h"
#include "tests/unit/client/scripted_server.h"
#include "tests/unit/formats/sample_frames.h"

namespace voxeld::client {
namespace {

using ::testing::ElementsAre;

constexpr size_t kFrames = 12;

std::vector<voxeld::Grid> written_frames() {
  const ChannelSet channels = {.color = true, .label = true};
  return test::mostly_static(3, {300, 50, 60}, 2000, kFrames, channels, 40);
}

std::vector<std::byte> container() {
  const auto bytes = test::sequence_bytes(written_frames());
  EXPECT_TRUE(bytes.ok());
  const auto view = std::as_bytes(std::span(*bytes));
  return {view.begin(), view.end()};
}

using Cells = std::map<std::array<int, 3>, std::pair<Color, int>>;

Cells cells_of(const voxeld::Grid& grid) {
  Cells cells;
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      const uint8_t* c = &tile.color[4 * voxel];
      cells[{x, y, z}] = {{c[0], c[1], c[2], c[3]}, tile.label[voxel]};
    });
  }
  return cells;
}

Cells cells_of(const Grid& grid) {
  Cells cells;
  grid.for_each([&](const Voxel& voxel) {
    cells[{voxel.x, voxel.y, voxel.z}] = {voxel.color, voxel.label};
  });
  return cells;
}

TEST(Sequence, holds_the_header_of_the_container) {
  const Sequence sequence = Sequence::decode(container());
  EXPECT_THAT(sequence.dims(), ElementsAre(300, 50, 60));
  EXPECT_THAT(sequence.origin(), ElementsAre(-1.5, 0.25, 1e10));
  EXPECT_THAT(sequence.voxel_size(), ElementsAre(0.5, 0.25, 0.125));
  EXPECT_THAT(sequence.channels(), ElementsAre("color", "label"));
  EXPECT_EQ(sequence.meta_json(), R"({"units":"mm"})");
  EXPECT_EQ(sequence.fps(), 24);
  EXPECT_EQ(sequence.frame_count(), kFrames);
  EXPECT_EQ(sequence.time_s(6), 0.25);
}

TEST(Sequence, frames_read_in_any_order_equal_those_written) {
  const auto frames = written_frames();
  Sequence sequence = Sequence::decode(container());
  for (const size_t index : {0u, 1u, 2u, 11u, 5u, 5u, 10u}) {
    SCOPED_TRACE(index);
    const Grid frame = sequence.frame(index);
    EXPECT_EQ(cells_of(frame), cells_of(frames[index]));
    EXPECT_EQ(frame.voxel_count(), frames[index].voxel_count());
    EXPECT_EQ(sequence.voxel_count(index), frames[index].voxel_count());
    EXPECT_EQ(frame.dims(), sequence.dims());
  }
}

TEST(Sequence, there_is_no_frame_after_the_last) {
  Sequence sequence = Sequence::decode(container());
  const Error error = error_of([&] { sequence.frame(kFrames); });
  EXPECT_EQ(error.code(), "not-found");
  EXPECT_STREQ(error.what(), "frame: expected 0 to 11, got 12");
  EXPECT_EQ(error_of([&] { (void)sequence.time_s(kFrames); }).code(), "not-found");
}

TEST(Sequence, a_broken_container_is_a_bad_response) {
  auto bytes = container();
  bytes[8] = std::byte{9};
  const Error error = error_of([&] { Sequence::decode(bytes); });
  EXPECT_EQ(error.code(), "bad-response");
  EXPECT_STREQ(error.what(), "sequence container, byte 8: version: expected 1, got 9");
  EXPECT_EQ(error_of([&] { Sequence::decode({}); }).code(), "bad-response");
}

TEST(Sequence, an_animation_is_voxelized_in_one_call) {
  const auto bytes = container();
  test::ScriptedServer server({test::json_response(R"({"id":"sha256-a"})"),
                               test::job_response("queued"), test::job_response("done"),
                               test::CannedResponse{.body = text_of(bytes)}});
  Client client(server.url());
  const Sequence sequence = client.voxelize_sequence(Source::memory(bytes_of("zip"), "bob.zip"),
                                                     Options().set("animation", "0"));
  EXPECT_EQ(sequence.frame_count(), kFrames);
  EXPECT_THAT(server.asked()[1].body, ::testing::HasSubstr(R"("format":"native")"));
}

}  // namespace
}  // namespace voxeld::client
