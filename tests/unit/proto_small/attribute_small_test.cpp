#include "proto/codec/attribute_small.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>

#include "proto/codec/attribute_context.h"
#include "proto/codec/stream_codec.h"
#include "proto/codec/voxel_numbers.h"
#include "proto/container/grid_format.h"
#include "tests/unit/proto/tile_maker.h"
#include "tests/unit/proto_small/small_shapes.h"

namespace voxeld {
namespace {

// Gives each voxel color(x, y, z).
template <typename Color>
SparseTile colored(SparseTile tile, Color&& color) {
  for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
    if (voxel == kNoAttributes) return;
    const std::array<int, 4> samples = color(x, y, z);
    for (const int sample : samples) tile.color.push_back(static_cast<uint8_t>(sample));
  });
  return tile;
}

SparseTile shell() {
  return test::sphere_shell(30, 2);
}
SparseTile smooth_shell() {
  return colored(shell(), [](int x, int y, int z) {
    return std::array{x, 100 + y / 4, (x + y + z) / 3, 255};
  });
}

// Normals of a sphere about the middle.
SparseTile normal_shell() {
  SparseTile tile = shell();
  for_each_voxel(tile, [&](int x, int y, int z, size_t) {
    const std::array<double, 3> d = {x - 127.5, y - 127.5, z - 127.5};
    const double length = std::hypot(d[0], d[1], d[2]);
    for (const double part : d) {
      tile.normal.push_back(static_cast<int8_t>(std::lround(127 * part / length)));
    }
  });
  return tile;
}

// Returns the bytes.
std::vector<uint8_t> expect_channel_round_trip(const SparseTile& tile, Channel channel) {
  const auto bytes = encode_channel_small(tile, channel);
  SparseTile back = tile;
  set_channel_bytes(back, channel, {});
  const Status status = decode_channel_small(bytes, channel, back);
  EXPECT_TRUE(status) << status.error().message();
  EXPECT_TRUE(back == tile);
  return bytes;
}
std::vector<uint8_t> expect_color_round_trip(const SparseTile& tile) {
  return expect_channel_round_trip(tile, Channel::kColor);
}
std::vector<uint8_t> expect_normal_round_trip(const SparseTile& tile) {
  return expect_channel_round_trip(tile, Channel::kNormal);
}

std::string color_refusal(std::span<const uint8_t> bytes, SparseTile tile) {
  tile.color.clear();
  const Status status = decode_channel_small(bytes, Channel::kColor, tile);
  EXPECT_FALSE(status);
  return status ? "" : status.error().message();
}

size_t fast_bytes(std::span<const uint8_t> samples, size_t channels) {
  return compress_stream(StreamKind::kPlanes, planes_from_samples(samples, channels))->size();
}
size_t fast_bytes(const SparseTile& tile, Channel channel) {
  return fast_bytes(channel_bytes(tile, channel), channel_info(channel).bytes());
}

constexpr ChannelSet kAll = channels_of_bits(test::kChannelSets - 1);

// A shell with labels in patches, and the distance of each cell from a sphere in 1/128 voxel.
SparseTile measured_shell() {
  SparseTile tile = test::sphere_shell(60, 4);
  for_each_voxel(tile, [&](int x, int y, int z, size_t) {
    tile.label.push_back(static_cast<uint16_t>(x + y < 220 ? 7 : z < 128 ? 300 : 8));
    const double radius = std::hypot(x - 127.5, y - 127.5, z - 127.5);
    tile.distance.push_back(static_cast<int16_t>(std::lround(128 * (radius - 62))));
    tile.coverage.push_back(
        static_cast<uint8_t>(std::clamp(std::lround(4 * (radius - 30)), 0L, 255L)));
  });
  return tile;
}

TEST(VoxelNumbers, are_those_that_for_each_voxel_counts) {
  std::mt19937 random(1);
  const SparseTile tile = test::tile_with_full_nodes(random, true, false);
  const VoxelNumbers numbers(tile);
  std::vector<uint32_t> expected(size_t{1} << 24, VoxelNumbers::kNone);
  for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
    if (voxel == kNoAttributes) return;
    expected[static_cast<size_t>(x + 256 * (y + 256 * z))] = static_cast<uint32_t>(voxel);
  });
  for (int i = 0; i < 1 << 24; ++i) {
    ASSERT_EQ(numbers.find(i & 255, i >> 8 & 255, i >> 16), expected[static_cast<size_t>(i)]) << i;
  }
  for (const int outside : {-1, 256, -256, 1 << 20}) {
    EXPECT_EQ(numbers.find(outside, 0, 0), VoxelNumbers::kNone);
    EXPECT_EQ(numbers.find(0, outside, 0), VoxelNumbers::kNone);
    EXPECT_EQ(numbers.find(0, 0, outside), VoxelNumbers::kNone);
  }
}

TEST(AttributeContext, steps_go_to_the_26_neighbours_faces_first) {
  EXPECT_EQ(kNeighborSteps[0].z, -1);
  EXPECT_EQ(kNeighborSteps[1].y, -1);
  EXPECT_EQ(kNeighborSteps[2].x, -1);
  int weights = 0;
  for (const NeighborStep& step : kNeighborSteps) {
    EXPECT_EQ(step.weight,
              4u - static_cast<uint32_t>(step.x * step.x + step.y * step.y + step.z * step.z));
    weights += static_cast<int>(step.weight);
  }
  EXPECT_EQ(weights, 6 * 3 + 12 * 2 + 8);
}

TEST(AttributeSmall, one_colour_costs_next_to_nothing) {
  const SparseTile tile = colored(shell(), [](int, int, int) {
    return std::array{200, 3, 77, 255};
  });
  EXPECT_LT(expect_color_round_trip(tile).size(), 100u);
}

TEST(AttributeSmall, colours_in_patches_cost_their_borders) {
  const SparseTile tile = colored(shell(), [](int x, int y, int) {
    return x + y < 200 ? std::array{255, 0, 0, 255} : std::array{0, 255, 0, 255};
  });
  EXPECT_LT(expect_color_round_trip(tile).size(), fast_bytes(tile.color, 4));
}

TEST(AttributeSmall, smooth_colours_cost_less_than_half_of_codec_fast) {
  const SparseTile tile = smooth_shell();
  EXPECT_LT(2 * expect_color_round_trip(tile).size(), fast_bytes(tile.color, 4));
}

TEST(AttributeSmall, smooth_normals_cost_less_than_two_thirds_of_codec_fast) {
  const SparseTile tile = normal_shell();
  const std::span<const uint8_t> samples(reinterpret_cast<const uint8_t*>(tile.normal.data()),
                                         tile.normal.size());
  EXPECT_LT(3 * expect_normal_round_trip(tile).size(), 2 * fast_bytes(samples, 3));
}

TEST(AttributeSmall, ids_in_patches_cost_next_to_nothing) {
  const SparseTile tile = measured_shell();
  const size_t bytes = expect_channel_round_trip(tile, Channel::kLabel).size();
  EXPECT_LT(50 * bytes, tile.label.size()) << bytes;  // 0.16 bits each
  EXPECT_LT(4 * bytes, fast_bytes(tile, Channel::kLabel));
}

TEST(AttributeSmall, distances_cost_less_than_a_third_and_coverage_less_than_codec_fast) {
  const SparseTile tile = measured_shell();
  EXPECT_LT(3 * expect_channel_round_trip(tile, Channel::kDistance).size(),
            fast_bytes(tile, Channel::kDistance));
  EXPECT_LT(expect_channel_round_trip(tile, Channel::kCoverage).size(),
            fast_bytes(tile, Channel::kCoverage));
}

TEST(AttributeSmall, differences_of_16_bits_wrap_around) {
  std::mt19937 random(9);
  SparseTile tile = test::noise(3, 3000);
  constexpr std::array<int, 8> kExtreme = {-32768, -32767, -129, -128, 0, 127, 32639, 32767};
  for (size_t i = 0; i < tile.attribute_count(); ++i) {
    tile.distance.push_back(static_cast<int16_t>(kExtreme[random() % kExtreme.size()]));
    tile.material.push_back(static_cast<uint16_t>(tile.distance.back()));
  }
  expect_channel_round_trip(tile, Channel::kDistance);
  expect_channel_round_trip(tile, Channel::kMaterial);
}

TEST(AttributeSmall, random_samples_of_every_channel_come_back_and_hardly_grow) {
  std::mt19937 random(11);
  const SparseTile tile = test::tile_with_full_nodes(random, kAll);
  for (const ChannelInfo& info : kChannels) {
    SCOPED_TRACE(info.name);
    EXPECT_LT(static_cast<double>(expect_channel_round_trip(tile, info.channel).size()),
              1.15 * static_cast<double>(channel_bytes(tile, info.channel).size()) + 100);
  }
}

TEST(AttributeSmall, random_attributes_come_back_and_hardly_grow) {
  std::mt19937 random(1);
  for (int round = 0; round < 2; ++round) {
    SCOPED_TRACE(round);
    const SparseTile tile = test::tile_with_full_nodes(random, true, true);
    EXPECT_LT(static_cast<double>(expect_color_round_trip(tile).size()),
              1.15 * static_cast<double>(tile.color.size()) + 100);
    EXPECT_LT(static_cast<double>(expect_normal_round_trip(tile).size()),
              1.15 * static_cast<double>(tile.normal.size()) + 100);
  }
}

TEST(AttributeSmall, every_sample_comes_back_from_beside_every_other) {
  std::mt19937 random(2);
  for (int round = 0; round < 5; ++round) {
    SCOPED_TRACE(round);
    SparseTile tile = test::noise(static_cast<uint32_t>(round), 5000);
    const size_t voxels = tile.attribute_count();
    // -128 is no component of a unit normal, but a stream may say it.
    constexpr std::array<int, 6> kExtreme = {-128, -127, -1, 0, 1, 127};
    for (size_t i = 0; i < 3 * voxels; ++i) {
      tile.normal.push_back(static_cast<int8_t>(kExtreme[random() % kExtreme.size()]));
    }
    for (size_t i = 0; i < 4 * voxels; ++i) {
      tile.color.push_back(static_cast<uint8_t>(random() % 2 == 0 ? random() : random() % 2 * 255));
    }
    expect_color_round_trip(tile);
    expect_normal_round_trip(tile);
  }
}

TEST(AttributeSmall, a_single_voxel_comes_back_from_few_bytes) {
  SparseTile tile = test::single_voxel(9, 99, 199);
  tile.color = {1, 2, 3, 4};
  tile.normal = {127, 0, -127};
  EXPECT_LE(expect_color_round_trip(tile).size(), 10u);
  EXPECT_LE(expect_normal_round_trip(tile).size(), 10u);
}

TEST(AttributeSmall, every_truncation_and_an_extra_byte_are_refused) {
  SparseTile tile = test::sphere_shell(6, 1);
  tile = colored(std::move(tile), [](int x, int y, int z) {
    return std::array{x * 3, y * 5, z * 7, 255};
  });
  auto bytes = encode_channel_small(tile, Channel::kColor);
  for (size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_EQ(color_refusal(std::span<const uint8_t>(bytes).first(size), tile),
              "grid container, small attributes: the stream is cut off")
        << size;
  }
  bytes.push_back(0);
  EXPECT_EQ(color_refusal(bytes, tile), "grid container, small attributes: bytes after the stream");
}

TEST(AttributeSmall, flipped_and_random_bytes_give_samples_or_an_error) {
  std::mt19937 random(4);
  const SparseTile tile = smooth_shell();
  const auto good = encode_channel_small(tile, Channel::kColor);
  int refused = 0;
  for (int round = 0; round < 30; ++round) {
    auto bytes = round % 2 == 0 ? good : std::vector<uint8_t>(random() % 3000);
    if (round % 2 == 1) {
      for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
    } else {
      bytes[random() % bytes.size()] ^= static_cast<uint8_t>(1u << random() % 8);
    }
    SparseTile back = shell();
    const Status color = decode_channel_small(bytes, Channel::kColor, back);
    const Status normal = decode_channel_small(bytes, Channel::kNormal, back);
    refused += color ? 0 : 1;
    EXPECT_TRUE(!color || back.color.size() == tile.color.size());
    EXPECT_TRUE(!normal || 4 * back.normal.size() == 3 * tile.color.size());
  }
  EXPECT_GT(refused, 15);
}

// The container around the streams.
TEST(GridSmall, each_stream_has_the_codec_that_the_header_says) {
  GridHeader header;
  header.dims = {256, 256, 256};
  header.voxel_size = {1, 1, 1};
  header.channels = kAll;
  SparseTile tile = test::sphere_shell(9, 2);
  tile.full = {{0, 1}};
  resize_channels(tile, kAll);
  for_each_channel(tile, [](Channel, auto& samples) {
    for (size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<uint8_t>(i / 5);
  });
  // Each stream with either codec beside every other.
  for (size_t codecs = 0; codecs < 128; codecs += 5) {
    const auto codec = [&](size_t bit) {
      return (codecs >> bit & 1) != 0 ? Codec::kSmall : Codec::kFast;
    };
    header.codecs.octree = codec(0);
    for (size_t i = 0; i < kChannelCount; ++i) header.codecs.channels[i] = codec(1 + i);
    const auto bytes = encode_grid(header, std::span(&tile, 1));
    ASSERT_TRUE(bytes) << bytes.error().message();
    const auto reader = GridReader::open(*bytes);
    ASSERT_TRUE(reader) << reader.error().message();
    EXPECT_EQ(reader->header().codecs, header.codecs);
    const auto back = reader->decode_tile(0);
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_TRUE(*back == tile);
  }
}

TEST(GridSmall, every_truncation_and_flipped_bit_of_a_container_is_an_error_or_a_grid) {
  SparseTile tile = test::sphere_shell(3, 1);
  tile.full = {{8, 1}};
  tile = colored(std::move(tile), [](int x, int y, int z) { return std::array{x, y, z, 255}; });
  GridHeader header;
  header.dims = {256, 256, 256};
  header.voxel_size = {1, 1, 1};
  header.channels.color = true;
  header.codecs = StreamCodecs::all(Codec::kSmall);
  const auto good = encode_grid(header, std::span(&tile, 1));
  ASSERT_TRUE(good) << good.error().message();
  const auto decode = [](std::span<const uint8_t> bytes) {
    const auto reader = GridReader::open(bytes);
    if (!reader) return reader.error().message();
    const auto back = reader->decode_tile(0);
    return back ? std::string() : back.error().message();
  };
  EXPECT_EQ(decode(*good), "");
  for (size_t size = 0; size < good->size(); ++size) {
    EXPECT_TRUE(decode(std::span(*good).first(size)).starts_with("grid container, ")) << size;
  }
  for (size_t at = 0; at < good->size(); ++at) {
    auto bytes = *good;
    bytes[at] ^= static_cast<uint8_t>(1u << at % 8);
    // An empty grid has no tile to decode.
    if (const auto reader = GridReader::open(bytes); reader && reader->tile_count() == 0) continue;
    const std::string text = decode(bytes);
    EXPECT_TRUE(text.empty() || text.starts_with("grid container, ")) << text;
  }
}

}  // namespace
}  // namespace voxeld
