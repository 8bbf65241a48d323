#include "proto/codec/stream_codec.h"

#include <gtest/gtest.h>

#include <random>
#include <string>

namespace voxeld {
namespace {

std::vector<uint8_t> random_bytes(size_t size, uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<uint8_t> bytes(size);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
  return bytes;
}

std::vector<uint8_t> compressed(std::span<const uint8_t> raw) {
  const auto stored = compress_stream(StreamKind::kPlanes, raw);
  EXPECT_TRUE(stored);
  return stored ? *stored : std::vector<uint8_t>();
}

std::string stream_refusal(std::span<const uint8_t> stored, size_t raw_max) {
  const auto raw = decompress_stream(stored, raw_max);
  EXPECT_FALSE(raw);
  if (raw) return "";
  EXPECT_EQ(raw.error().code, ErrorCode::kBadRequest);
  return raw.error().message();
}

TEST(StreamCodec, bytes_come_back) {
  for (const size_t size : {0, 1, 2, 255, 4096, 300000}) {
    const auto raw = random_bytes(size, 1);
    const auto back = decompress_stream(compressed(raw), size);
    ASSERT_TRUE(back) << size << ": " << back.error().message();
    EXPECT_EQ(*back, raw);
  }
}

TEST(StreamCodec, a_stream_carries_its_size_and_a_checksum) {
  const auto stored = compressed(random_bytes(1000, 2));
  ASSERT_GT(stored.size(), 6u);
  // RFC 8878, frame header descriptor: bit 2 is the checksum; 1000 bytes need a 2-byte size.
  EXPECT_EQ(stored[4] & 0x04, 0x04);
  EXPECT_EQ(stored[4] >> 6, 1);
}

TEST(StreamCodec, every_truncation_and_every_extra_byte_is_refused) {
  const auto stored = compressed(random_bytes(500, 3));
  for (size_t size = 0; size < stored.size(); ++size) {
    const std::string text = stream_refusal(std::span(stored).first(size), 500);
    EXPECT_TRUE(text.starts_with("grid container, stream: ")) << text;
  }
  auto longer = stored;
  longer.push_back(0);
  stream_refusal(longer, 500);
  longer = stored;
  longer.insert(longer.end(), stored.begin(), stored.end());
  EXPECT_EQ(stream_refusal(longer, 1000), "grid container, stream: bytes after the zstd frame");
}

TEST(StreamCodec, a_frame_that_says_more_than_its_place_needs_is_refused) {
  const std::vector<uint8_t> zeros(1 << 20);
  const auto bomb = compressed(zeros);
  EXPECT_LT(bomb.size(), 100u);
  EXPECT_EQ(stream_refusal(bomb, (1 << 20) - 1),
            "grid container, stream: expected at most 1048575 bytes, got 1048576");
  EXPECT_TRUE(decompress_stream(bomb, 1 << 20));
}

TEST(StreamCodec, a_frame_of_a_billion_billion_bytes_is_refused_by_its_declared_size) {
  // Magic, descriptor with an 8-byte size and a single segment, size, one empty last block.
  const std::vector<uint8_t> bomb = {0x28, 0xb5, 0x2f, 0xfd, 0xe0, 0xff, 0xff, 0xff,
                                     0xff, 0xff, 0xff, 0xff, 0x0f, 0x01, 0x00, 0x00};
  EXPECT_EQ(stream_refusal(bomb, 4096),
            "grid container, stream: expected at most 4096 bytes, got 1152921504606846975");
}

TEST(StreamCodec, a_frame_without_its_size_is_refused) {
  // Magic, descriptor without a size, window of 1 KiB, one empty last block.
  const std::vector<uint8_t> frame = {0x28, 0xb5, 0x2f, 0xfd, 0x00, 0x00, 0x01, 0x00, 0x00};
  EXPECT_EQ(stream_refusal(frame, 4096),
            "grid container, stream: the zstd frame does not say its size");
}

TEST(StreamCodec, a_frame_that_holds_less_than_it_says_is_refused) {
  // Single segment, one byte of size: 5, one empty last block.
  const std::vector<uint8_t> frame = {0x28, 0xb5, 0x2f, 0xfd, 0x20, 0x05, 0x01, 0x00, 0x00};
  const std::string text = stream_refusal(frame, 4096);
  EXPECT_TRUE(text.starts_with("grid container, stream: ")) << text;
}

TEST(StreamCodec, every_flipped_bit_is_refused_or_harmless) {
  const auto raw = random_bytes(64, 4);
  const auto stored = compressed(raw);
  for (size_t bit = 0; bit < 8 * stored.size(); ++bit) {
    auto flipped = stored;
    flipped[bit / 8] = static_cast<uint8_t>(flipped[bit / 8] ^ 1u << (bit % 8));
    // The checksum catches what changes the content.
    const auto back = decompress_stream(flipped, 4096);
    EXPECT_TRUE(!back || *back == raw) << bit;
  }
}

TEST(Planes, are_differences_of_each_channel_in_turn) {
  const std::vector<uint8_t> samples = {10, 200, 12, 100, 11, 255};
  const std::vector<uint8_t> planes = {10, 2, 255, 200, 156, 155};
  EXPECT_EQ(planes_from_samples(samples, 2), planes);
  EXPECT_EQ(samples_from_planes(planes, 2), samples);
}

TEST(Planes, come_back_for_every_number_of_channels) {
  for (const size_t channels : {1, 3, 4}) {
    for (const size_t voxels : {0, 1, 777}) {
      const auto samples = random_bytes(channels * voxels, 5);
      EXPECT_EQ(samples_from_planes(planes_from_samples(samples, channels), channels), samples);
    }
  }
}

}  // namespace
}  // namespace voxeld
