// Animated PNG chunk by chunk, delays and sheets.
#include "server/render/animated_image.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <string>

#include "proto/limits.h"
#include "server/base/disk/file.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/render/plain_images.h"

namespace voxeld {
namespace {

uint32_t big_endian(const std::vector<uint8_t>& bytes, size_t at, size_t count) {
  uint32_t value = 0;
  for (size_t i = 0; i < count; ++i) value = value << 8 | bytes[at + i];
  return value;
}

// A chunk's type and data.
using Chunks = std::vector<std::pair<std::string, std::vector<uint8_t>>>;

// Bit by bit, as the PNG specification has it, and not by tables.
uint32_t crc_bit_by_bit(const std::vector<uint8_t>& bytes, size_t begin, size_t end) {
  uint32_t crc = 0xffffffffu;
  for (size_t i = begin; i < end; ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      const bool one = ((crc ^ static_cast<uint32_t>(bytes[i] >> bit)) & 1u) != 0;
      crc = crc >> 1;
      if (one) crc ^= 0xedb88320u;
    }
  }
  return crc ^ 0xffffffffu;
}

Chunks chunks_of(const std::vector<uint8_t>& png) {
  Chunks chunks;
  for (size_t at = 8; at + 12 <= png.size();) {
    const size_t bytes = big_endian(png, at, 4);
    const auto begin = png.begin() + static_cast<std::ptrdiff_t>(at);
    EXPECT_LE(at + 12 + bytes, png.size());
    EXPECT_EQ(big_endian(png, at + 8 + bytes, 4), crc_bit_by_bit(png, at + 4, at + 8 + bytes));
    chunks.emplace_back(std::string(begin + 4, begin + 8),
                        std::vector<uint8_t>(begin + 8, begin + 8 + static_cast<long>(bytes)));
    at += 12 + bytes;
  }
  return chunks;
}

TEST(Apng, chunks_are_numbered_and_each_image_is_the_stream_of_its_own_png) {
  const testing::TemporaryDir dir;
  const auto path = dir.path() / "four.png";
  write_all_to(write_apng(path, {0.1, 1.0 / 24, 0.5, 3.0}));
  const auto bytes = read_file(path);
  ASSERT_TRUE(bytes.ok());
  const Chunks chunks = chunks_of(*bytes);
  EXPECT_EQ(chunks.front().first, "IHDR");
  EXPECT_EQ(chunks.back().first, "IEND");
  uint32_t number = 0;
  std::vector<uint32_t> delays;
  std::vector<std::vector<uint8_t>> streams;
  for (const auto& [type, data] : chunks) {
    if (type == "acTL") {
      EXPECT_TRUE(streams.empty());
      EXPECT_EQ(big_endian(data, 0, 4), 4u);
      EXPECT_EQ(big_endian(data, 4, 4), 0u);  // for ever
    } else if (type == "fcTL") {
      ASSERT_EQ(data.size(), 26u);
      EXPECT_EQ(big_endian(data, 0, 4), number++);
      EXPECT_EQ(big_endian(data, 4, 4), 20u);
      EXPECT_EQ(big_endian(data, 8, 4), 12u);
      EXPECT_EQ(big_endian(data, 22, 2), 1000u);
      delays.push_back(big_endian(data, 20, 2));
      streams.emplace_back();
    } else if (type == "fdAT") {
      EXPECT_EQ(big_endian(data, 0, 4), number++);
      streams.back().insert(streams.back().end(), data.begin() + 4, data.end());
    } else if (type == "IDAT") {
      EXPECT_EQ(streams.size(), 1u);
      streams.back().insert(streams.back().end(), data.begin(), data.end());
    }
  }
  EXPECT_EQ(delays, (std::vector<uint32_t>{100, 42, 500, 3000}));
  ASSERT_EQ(streams.size(), 4u);
  for (size_t i = 0; i < streams.size(); ++i) {
    const auto png = encode_png(plain(20, 12, kColors[i]));
    std::vector<uint8_t> expected;
    for (const auto& [type, data] : chunks_of(*png)) {
      if (type == "IDAT") expected.insert(expected.end(), data.begin(), data.end());
    }
    EXPECT_EQ(streams[i], expected) << i;
  }
}

TEST(Apng, an_image_that_is_shown_for_long_has_coarser_parts) {
  const testing::TemporaryDir dir;
  const auto path = dir.path() / "long.png";
  write_all_to(write_apng(path, {0.04, 70.0, 0.04, 7000.5}));
  const auto bytes = read_file(path);
  ASSERT_TRUE(bytes.ok());
  std::vector<std::pair<uint32_t, uint32_t>> delays;
  for (const auto& [type, data] : chunks_of(*bytes)) {
    if (type == "fcTL") delays.emplace_back(big_endian(data, 20, 2), big_endian(data, 22, 2));
  }
  EXPECT_EQ(delays, (std::vector<std::pair<uint32_t, uint32_t>>{
                        {40, 1000}, {7000, 100}, {40, 1000}, {7001, 1}}));
}

std::vector<uint32_t> gif_parts(const std::vector<double>& durations_s) {
  std::vector<uint32_t> parts;
  const auto times = shown_times(ImageKind::kGif, durations_s);
  EXPECT_TRUE(times.ok());
  for (const ShownTime& time : *times) {
    EXPECT_EQ(time.parts_per_s, 100);
    parts.push_back(time.parts);
  }
  return parts;
}

TEST(ShownTimes, rounding_is_passed_on_so_that_the_whole_keeps_its_length) {
  const auto parts = gif_parts(std::vector<double>(24, 1.0 / 24));
  uint32_t sum = 0;
  for (const uint32_t part : parts) {
    EXPECT_TRUE(part == 4 || part == 5) << part;
    sum += part;
  }
  EXPECT_EQ(sum, 100u);
  EXPECT_EQ(gif_parts({0.001, 0.0}), (std::vector<uint32_t>{2, 2}));
  EXPECT_EQ(gif_parts({655.35}), (std::vector<uint32_t>{65'535}));
}

TEST(ShownTimes, an_image_that_a_file_cannot_show_for_so_long_is_refused) {
  const auto message = [](ImageKind kind, double second_s) {
    const auto times = shown_times(kind, {0.5, second_s});
    EXPECT_EQ(times.error().code, ErrorCode::kInvalidOption);
    return times.error().message();
  };
  EXPECT_EQ(message(ImageKind::kGif, 700),
            "image: image 1 of the GIF is shown for too long: expected at most 655.35 seconds, by "
            "rate or by times that are closer together, got 700 seconds");
  EXPECT_EQ(message(ImageKind::kApng, 86'400),
            "image: image 1 of the PNG is shown for too long: expected at most 65535 seconds, by "
            "rate or by times that are closer together, got 86400 seconds");
  const testing::TemporaryDir dir;
  EXPECT_FALSE(write_gif(dir.path() / "long.gif", {700}).ok());
  EXPECT_FALSE(write_apng(dir.path() / "long.png", {86'400}).ok());
}

TEST(Sheet, images_stand_row_by_row_on_the_background) {
  const auto layout = sheet_layout(5, 0, 2, 3);
  ASSERT_TRUE(layout.ok());
  EXPECT_EQ(layout->columns, 3);
  EXPECT_EQ(layout->rows, 2);
  RenderImage sheet = begin_sheet(*layout, {9, 8, 7, 6});
  ASSERT_EQ(sheet.width, 6);
  ASSERT_EQ(sheet.height, 6);
  for (size_t i = 0; i < 5; ++i) {
    place_in_sheet(*layout, i, plain(2, 3, {static_cast<uint8_t>(i + 1), 0, 0, 255}), sheet);
  }
  std::string rows;
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 6; ++x) {
      rows += std::to_string(sheet.rgba[4 * (static_cast<size_t>(y) * 6 + static_cast<size_t>(x))]);
    }
    rows += "\n";
  }
  EXPECT_EQ(rows, "112233\n112233\n112233\n445599\n445599\n445599\n");
}

TEST(Sheet, columns_may_be_given_and_no_column_is_empty) {
  EXPECT_EQ(sheet_layout(10, 4, 1, 1)->rows, 3);
  EXPECT_EQ(sheet_layout(3, 100, 1, 1)->columns, 3);
  EXPECT_EQ(sheet_layout(1, 0, 1, 1)->columns, 1);
}

TEST(Sheet, a_sheet_that_is_too_large_says_by_how_much) {
  const auto layout = sheet_layout(4096, 0, 512, 256);
  ASSERT_FALSE(layout.ok());
  EXPECT_EQ(layout.error().code, ErrorCode::kInvalidOption);
  EXPECT_EQ(layout.error().message(),
            "image: the sheet is too large: expected at most 16384 pixels to a side, by fewer or "
            "smaller images, got 4096 images of 512 x 256 pixels in 64 columns: 32768 x 16384");
  EXPECT_TRUE(sheet_layout(4096, 0, 256, 256).ok());
}

}  // namespace
}  // namespace voxeld
