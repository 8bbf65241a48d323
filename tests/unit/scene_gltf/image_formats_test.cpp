// The contract of decode_image() for each reader, on files that the formats' own libraries wrote,
// and the formats that OpenImageIO does not write.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>

#include "server/base/cancel_point.h"
#include "server/scene/images/image.h"
#include "tests/unit/scene_gltf/image_files.h"

namespace voxeld {
namespace {

using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;

std::string image_error(const Bytes& bytes, PixelBudget* budget = nullptr) {
  const auto image = decode_image("a", bytes, budget);
  if (image) return "ok";
  return std::string(info_of(image.error().code).name) + ": " + image.error().message();
}

constexpr const char* kTooLarge =
    "payload-too-large: a: the image is too large: expected at most 67108864 pixels, 32768 to a "
    "side, got 9000 x 9000 pixels";

TEST(ImageFormats, every_truncation_is_refused_or_has_all_pixels) {
  for (const SampleFile& sample : sample_files()) {
    EXPECT_EQ(image_error(sample.bytes), "ok") << sample.name;
    for (size_t size = 0; size < sample.bytes.size(); ++size) {
      // A copy of that size, so that a sanitizer sees each byte that is read after its end.
      const Bytes cut(sample.bytes.begin(), sample.bytes.begin() + static_cast<ptrdiff_t>(size));
      const auto image = decode_image("a", cut);
      EXPECT_TRUE(!image || image->rgba.size() == 4 * sample.pixel_count)
          << sample.name << " " << size;
    }
  }
}

// A file that lacks a byte of its pixels. JPEG, PNG and GIF end with marks that tell nothing.
TEST(ImageFormats, missing_pixels_are_an_error) {
  for (const SampleFile& sample : sample_files()) {
    const bool ends_with_mark =
        sample.name.ends_with("jpeg") || sample.name.ends_with("png") || sample.name == "gif";
    const size_t less = ends_with_mark ? sample.bytes.size() / 3 : 1;
    Bytes cut = sample.bytes;
    cut.resize(cut.size() - less);
    EXPECT_THAT(image_error(cut), HasSubstr("malformed-image: a: ")) << sample.name;
  }
}

TEST(ImageFormats, every_flipped_byte_is_refused_or_has_pixels) {
  for (const SampleFile& sample : sample_files()) {
    for (size_t at = 0; at < sample.bytes.size(); ++at) {
      Bytes broken = sample.bytes;
      broken[at] ^= 0xff;
      PixelBudget budget;
      const auto image = decode_image("a", broken, &budget);
      if (!image) continue;
      EXPECT_EQ(image->rgba.size(), size_t{4} * image->width * image->height) << sample.name;
    }
  }
}

TEST(ImageFormats, a_spent_budget_refuses_every_format) {
  for (const SampleFile& sample : sample_files()) {
    PixelBudget budget;
    for (int i = 0; i < 4; ++i) EXPECT_TRUE(budget.take("b", 8192, 8192, size_t{1} << 33));
    EXPECT_THAT(image_error(sample.bytes, &budget), HasSubstr("payload-too-large: a is left out: "))
        << sample.name;
    EXPECT_TRUE(budget.is_spent());
  }
}

TEST(ImageFormats, every_reader_can_be_cancelled) {
  std::atomic<bool> cancelled{true};
  for (const SampleFile& sample : sample_files()) {
    const CancelScope scope(cancelled);
    EXPECT_THROW((void)sample.decode("a", sample.bytes, nullptr).ok(), Cancelled) << sample.name;
  }
}

void put_le(Bytes& bytes, size_t at, uint32_t value, size_t count) {
  for (size_t i = 0; i < count; ++i) bytes[at + i] = static_cast<uint8_t>(value >> (8 * i));
}

TEST(ImageFormats, size_is_refused_before_pixels_in_every_format) {
  EXPECT_EQ(image_error(png_of({.color_type = 0, .depth = 1}, 9000, 9000)), kTooLarge);

  Bytes jpeg = jpeg_of({}, 24, 20);
  const Bytes frame = {0xff, 0xc0};
  const auto found = std::search(jpeg.begin(), jpeg.end(), frame.begin(), frame.end());
  ASSERT_NE(found, jpeg.end());
  const auto sides = found + 5;
  sides[0] = sides[2] = 9000 >> 8;
  sides[1] = sides[3] = 9000 & 255;
  EXPECT_EQ(image_error(jpeg), kTooLarge);

  Bytes webp = webp_of(noise(4 * 63), 9);
  const uint32_t sides_and_alpha = 8999u | 8999u << 14 | 1u << 28;
  put_le(webp, 21, sides_and_alpha, 4);
  EXPECT_EQ(image_error(webp), kTooLarge);

  Bytes tiff = tiff_of({}, 9, 7);
  const size_t directory = tiff[4] | size_t{tiff[5]} << 8;
  ASSERT_EQ(tiff[directory + 2], 0);  // tag 256, width; the next is the height
  put_le(tiff, directory + 2 + 8, 9000, 2);
  put_le(tiff, directory + 2 + 12 + 8, 9000, 2);
  EXPECT_EQ(image_error(tiff), kTooLarge);

  Bytes gif = gif_of({}, noise(63), 9);
  put_le(gif, 6, 9000 | 9000u << 16, 4);
  EXPECT_EQ(image_error(gif), kTooLarge);

  EXPECT_EQ(image_error(bmp_of(24, 9000, 9000, {})), kTooLarge);
  EXPECT_EQ(image_error(bmp_of(24, 9000, -9000, {})), kTooLarge);
  EXPECT_EQ(image_error(hdr_of("-Y 9000 +X 9000", {})), kTooLarge);
  EXPECT_EQ(image_error(dds_of({.width = 9000, .height = 9000, .letters = "DXT1"}, {})), kTooLarge);
}

// The size of a real file, without its pixels.
TEST(ImageFormats, a_small_file_cannot_ask_for_much_memory) {
  EXPECT_EQ(image_error(bmp_of(32, 8192, 8192, noise(4))),
            "malformed-image: a: the image is cut off: expected at least 268435510 bytes, got 58 "
            "bytes");
  EXPECT_EQ(image_error(dds_of({.width = 8192, .height = 8192, .letters = "DXT1"}, noise(8))),
            "malformed-image: a: the image is cut off: expected at least 33554560 bytes, got 136 "
            "bytes");
}

TEST(ImageFormats, errors_of_libraries_say_what_is_wrong) {
  Bytes png = png_of({}, 9, 7);
  png.resize(60);
  EXPECT_EQ(image_error(png), "malformed-image: a: the image is cut off");
  png = png_of({}, 9, 7);
  png[20] ^= 1;
  EXPECT_EQ(image_error(png), "malformed-image: a: IHDR: CRC error");
  Bytes jpeg = jpeg_of({}, 24, 20);
  jpeg.resize(jpeg.size() - 40);
  EXPECT_EQ(image_error(jpeg), "malformed-image: a: the image is cut off");
  EXPECT_EQ(image_error({0xff, 0xd8, 0xff, 0xd9}),
            "malformed-image: a: JPEG datastream contains no image");
  EXPECT_EQ(image_error({'G', 'I', 'F', '8', '9', 'a'}),
            "malformed-image: a: No screen descriptor detected");
  EXPECT_THAT(image_error({'I', 'I', '*', 0, 8, 0, 0, 0}), HasSubstr("malformed-image: a: "));
  EXPECT_EQ(image_error({'R', 'I', 'F', 'F', 4, 0, 0, 0, 'W', 'E', 'B', 'P', ' '}),
            "malformed-image: a: not a valid WebP stream");
}

// Scans of a progressive JPEG cost as much as the image, and need a few bytes.
TEST(ImageFormats, jpeg_of_very_many_scans_is_refused) {
  const Bytes jpeg = jpeg_of({.is_progressive = true}, 24, 20);
  const Bytes mark = {0xff, 0xda}, table = {0xff, 0xc4};
  const auto begin = std::search(jpeg.begin(), jpeg.end(), mark.begin(), mark.end());
  const auto end = std::search(begin, jpeg.end(), table.begin(), table.end());
  Bytes many(jpeg.begin(), begin);
  for (int i = 0; i < 600; ++i) many.insert(many.end(), begin, end);
  many.insert(many.end(), begin, jpeg.end());
  EXPECT_EQ(image_error(many), "malformed-image: a: too many scans");
}

TEST(ImageFormats, webp_keeps_straight_alpha) {
  const Bytes rgba = {200, 100, 50, 1, 4, 5, 6, 255, 1, 2, 3, 128, 9, 9, 9, 77};
  EXPECT_EQ(pixels(webp_of(rgba, 2)), rgba);
}

TEST(ImageFormats, gif_has_its_frame_on_a_transparent_screen) {
  const GifKind kind{.transparent = 7, .left = 1, .top = 1, .screen_width = 3, .screen_height = 2};
  EXPECT_THAT(pixels(gif_of(kind, {7, 9}, 2)),
              ElementsAre(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,  //
                          0, 0, 0, 0, 0, 0, 0, 0, 9, 18, 246, 255));
}

TEST(ImageFormats, interlaced_gif_has_its_rows_in_order) {
  Bytes indices(17);
  for (size_t i = 0; i < indices.size(); ++i) indices[i] = static_cast<uint8_t>(i);
  const Bytes rgba = pixels(gif_of({.is_interlaced = true}, indices, 1));
  ASSERT_EQ(rgba.size(), 4 * indices.size());
  for (size_t i = 0; i < indices.size(); ++i) EXPECT_EQ(rgba[4 * i], i);
}

TEST(ImageFormats, gif_frame_outside_of_its_screen_is_refused) {
  Bytes gif = gif_of({}, noise(6), 3);
  gif[6] = 2;
  EXPECT_EQ(image_error(gif),
            "malformed-image: a: the first frame: expected within 2 x 2 pixels, got 3 x 2 at 0, 0");
}

TEST(ImageFormats, bmp_of_every_depth) {
  EXPECT_THAT(pixels(bmp_of(24, 1, 2, {3, 2, 1, 0, 6, 5, 4, 0})),  // from the bottom, rows of 4
              ElementsAre(4, 5, 6, 255, 1, 2, 3, 255));
  EXPECT_THAT(pixels(bmp_of(24, 1, -2, {3, 2, 1, 0, 6, 5, 4, 0})),
              ElementsAre(1, 2, 3, 255, 4, 5, 6, 255));
  EXPECT_THAT(pixels(bmp_of(32, 1, 1, {3, 2, 1, 4})), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(pixels(bmp_of(8, 2, 1, {1, 0, 0, 0}, {3, 2, 1, 0, 6, 5, 4, 0})),
              ElementsAre(4, 5, 6, 255, 1, 2, 3, 255));
  EXPECT_THAT(pixels(bmp_of(4, 2, 1, {0x10, 0, 0, 0}, {3, 2, 1, 0, 6, 5, 4, 0})),
              ElementsAre(4, 5, 6, 255, 1, 2, 3, 255));
  EXPECT_THAT(pixels(bmp_of(1, 2, 1, {0x80, 0, 0, 0}, {3, 2, 1, 0, 6, 5, 4, 0})),
              ElementsAre(4, 5, 6, 255, 1, 2, 3, 255));
}

TEST(ImageFormats, hdr_in_runs_in_order_and_repeated) {
  // Exponent 128: mantissas in 1/256. Linear 1/2 is 188 in sRGB, and 0.25 is 137.
  const Bytes runs = {2, 2, 0, 8, 136, 128, 136, 64, 8, 0, 0, 0, 0, 0, 0, 0, 255, 136, 128};
  const Bytes rgba = pixels(hdr_of("-Y 1 +X 8", runs));
  ASSERT_EQ(rgba.size(), 32u);
  EXPECT_THAT(Bytes(rgba.begin(), rgba.begin() + 4), ElementsAre(188, 137, 0, 255));
  EXPECT_THAT(Bytes(rgba.end() - 4, rgba.end()), ElementsAre(188, 137, 255, 255));
  // Exponent 140 is far above 1.
  EXPECT_THAT(pixels(hdr_of("-Y 1 +X 2", {128, 64, 0, 128, 1, 128, 255, 140})),
              ElementsAre(188, 137, 0, 255, 255, 255, 255, 255));
  EXPECT_THAT(pixels(hdr_of("-Y 2 +X 3", {0, 128, 0, 128, 1, 1, 1, 2, 1, 1, 1, 3})),
              ElementsAreArray(Bytes{0, 188, 0, 255, 0, 188, 0, 255, 0, 188, 0, 255,  //
                                     0, 188, 0, 255, 0, 188, 0, 255, 0, 188, 0, 255}));
}

TEST(ImageFormats, hdr_errors_say_what_and_where) {
  EXPECT_EQ(image_error(hdr_of("+Y 1 +X 8", {})),
            "malformed-image: a: size of the image: expected -Y height +X width, got \"+Y 1 +X "
            "8\"");
  EXPECT_EQ(image_error(hdr_of("-Y 1 +X 8", {2, 2, 0, 9})),
            "malformed-image: a: byte 47: width of a row: expected 8, got 9");
  EXPECT_EQ(image_error(hdr_of("-Y 1 +X 8", {2, 2, 0, 8, 137, 1})),
            "malformed-image: a: byte 49: a run goes beyond its row: expected 1 to 8 pixels, got "
            "9");
  EXPECT_EQ(image_error(hdr_of("-Y 1 +X 2", {1, 2, 3})),
            "malformed-image: a: the image is cut off: expected at least 49 bytes, got 48 bytes");
  EXPECT_EQ(image_error({'#', '?', 'R', 'G', 'B', 'E', '\n'}),
            "malformed-image: a: the header does not end: expected an empty line and -Y height +X "
            "width, got the end of the file");
  const std::string xyze = "#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n1234";
  EXPECT_EQ(image_error(Bytes(xyze.begin(), xyze.end())),
            "malformed-image: a: format of the pixels: expected 32-bit_rle_rgbe, got "
            "\"32-bit_rle_xyze\"");
}

TEST(ImageFormats, tiff_alpha_is_straight) {
  const Bytes rgba = {200, 100, 50, 1, 4, 5, 6, 255};
  EXPECT_EQ(pixels(tiff_of({.channel_count = 4}, 2, 1, rgba)), rgba);
  EXPECT_THAT(pixels(tiff_of({.channel_count = 4, .is_multiplied = true}, 2, 1,
                             {100, 50, 0, 128, 4, 5, 6, 255})),
              ElementsAre(199, 100, 0, 128, 4, 5, 6, 255));
  EXPECT_THAT(pixels(tiff_of({.channel_count = 2}, 2, 1, {7, 8, 9, 10})),
              ElementsAre(7, 7, 7, 8, 9, 9, 9, 10));
}

TEST(ImageFormats, tiff_compressions_that_are_not_read_are_named) {
  Bytes tiff = tiff_of({.channel_count = 1}, 2, 1);
  const size_t directory = tiff[4] | size_t{tiff[5]} << 8;
  for (size_t at = directory + 2; at + 12 <= tiff.size(); at += 12) {
    if (tiff[at] == 3 && tiff[at + 1] == 1) put_le(tiff, at + 8, 34661, 2);  // tag 259
  }
  EXPECT_EQ(image_error(tiff),
            "unsupported-feature: a: compression of the TIFF: expected none, LZW, Deflate, JPEG, "
            "PackBits or CCITT, got 34661");
}

}  // namespace
}  // namespace voxeld
