// Each entry of kChannels, alone and with all others, in what only the table knows: containers of
// both codecs, the content hash, and dense arrays. A new entry is tested here without a line.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <type_traits>

#include "server/formats/formats.h"
#include "server/formats/npy/npy_array.h"
#include "server/grid/content_hash.h"
#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

std::vector<ChannelSet> channel_sets() {
  std::vector<ChannelSet> sets(1);
  for (const ChannelInfo& info : kChannels) {
    sets.front().set(info.channel);
    sets.emplace_back().set(info.channel);
  }
  return sets;
}

Grid grid_with(const ChannelSet& channels) {
  std::mt19937 random(7);
  Grid grid = test::grid_of({96, 40, 40}, test::random_voxels(random, {64, 40, 40}, 500), channels);
  grid.tiles[0].full = {{morton_encode(10, 1, 1), 0}};
  for_each_channel(grid.tiles[0], [&](Channel, auto& samples) {
    for (auto& sample : samples) sample = static_cast<std::decay_t<decltype(sample)>>(random());
  });
  return grid;
}

TEST(EveryChannel, comes_back_from_a_container_of_either_codec) {
  for (const ChannelSet& channels : channel_sets()) {
    const Grid grid = grid_with(channels);
    ASSERT_TRUE(grid.tiles[0].has_attributes());
    for (const Codec codec : {Codec::kFast, Codec::kSmall}) {
      OutputOptions options;
      options.codec = codec;
      const auto bytes = encode(grid, options);
      ASSERT_TRUE(bytes) << bytes.error().message();
      const auto back = grid_from_container(*bytes);
      ASSERT_TRUE(back) << back.error().message();
      EXPECT_EQ(back->channels, channels);
      EXPECT_TRUE(back->tiles == grid.tiles) << channel_bits(channels);
    }
  }
}

TEST(EveryChannel, is_a_part_of_the_content_hash) {
  for (const ChannelInfo& info : kChannels) {
    ChannelSet channels;
    channels.set(info.channel);
    Grid grid = grid_with(channels);
    const std::string hash = content_hash(grid);
    with_channel_member(info.channel, [&](Channel, auto member) {
      auto& last = (grid.tiles[0].*member).back();
      last = static_cast<SampleOf<decltype(member)>>(last ^ 1);
    });
    EXPECT_NE(content_hash(grid), hash) << info.name;
  }
}

TEST(EveryChannel, has_an_array_of_its_type_in_every_dtype_and_order) {
  for (const ChannelInfo& info : kChannels) {
    ChannelSet channels;
    channels.set(info.channel);
    const Grid grid = grid_with(channels);
    for (const DType dtype : {DType::kUint8, DType::kBool, DType::kFloat32}) {
      for (const AxisOrder axes : {AxisOrder::kZyx, AxisOrder::kXyz}) {
        OutputOptions options;
        options.dtype = dtype;
        options.axes = axes;
        const NpyType type = npy_type(info.channel, options);
        const auto array = test::read_npy(test::npy_of(grid, info.channel, options));
        EXPECT_EQ(array.descr, type.descr) << info.name;
        EXPECT_EQ(type.components, info.components) << info.name;
        EXPECT_EQ(array.descr == "<f4", !info.is_id() && (dtype == DType::kFloat32 ||
                                                          info.kind == ChannelKind::kDistance));
        EXPECT_EQ(array.data.size(), size_t{96} * 40 * 40 * type.components * type.sample_bytes);
        EXPECT_TRUE(std::ranges::any_of(array.data, [](uint8_t byte) { return byte != 0; }));
      }
    }
  }
}

}  // namespace
}  // namespace voxeld
