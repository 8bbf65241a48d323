// Textures through OpenImageIO: which formats, which pixels, which refusals.
#include "server/scene/images/image.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>

#include "server/base/cancel_point.h"
#include "tests/unit/scene_gltf/gltf_builder.h"

namespace voxeld {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// A file of 2 x 1 pixels in the format that the extension names.
template <typename T>
Bytes encode(const char* file_name, int channel_count, const std::vector<T>& values, int width = 2,
             int height = 1) {
  const OIIO::TypeDesc type = OIIO::TypeDescFromC<T>::value();
  OIIO::Filesystem::IOVecOutput memory;
  const auto out = OIIO::ImageOutput::create(file_name, &memory);
  OIIO::ImageSpec spec(width, height, channel_count, type);
  spec["oiio:UnassociatedAlpha"] = 1;
  spec["CompressionQuality"] = 100;
  EXPECT_TRUE(out && out->open(file_name, spec)) << (out ? out->geterror() : OIIO::geterror());
  EXPECT_TRUE(out->write_image(type, values.data())) << out->geterror();
  out->close();
  return memory.buffer();
}

std::vector<uint8_t> pixels(const Bytes& bytes) {
  const auto image = decode_image("a", bytes);
  EXPECT_TRUE(image.ok()) << (image ? "" : image.error().message());
  return image ? image->rgba : std::vector<uint8_t>();
}

std::string error(const Bytes& bytes) {
  const auto image = decode_image("a.png", bytes);
  if (image) return "ok";
  return std::string(info_of(image.error().code).name) + ": " + image.error().message();
}

TEST(Image, png_of_every_count_of_channels) {
  EXPECT_THAT(pixels(encode<uint8_t>("a.png", 1, {7, 9})), ElementsAre(7, 7, 7, 255, 9, 9, 9, 255));
  EXPECT_THAT(pixels(encode<uint8_t>("a.png", 2, {7, 8, 9, 10})),
              ElementsAre(7, 7, 7, 8, 9, 9, 9, 10));
  EXPECT_THAT(pixels(encode<uint8_t>("a.png", 3, {1, 2, 3, 4, 5, 6})),
              ElementsAre(1, 2, 3, 255, 4, 5, 6, 255));
  // Alpha stays straight: colours under small alpha are not darkened.
  EXPECT_THAT(pixels(encode<uint8_t>("a.png", 4, {200, 100, 50, 1, 4, 5, 6, 255})),
              ElementsAre(200, 100, 50, 1, 4, 5, 6, 255));
}

TEST(Image, sixteen_bits_are_rounded_to_eight) {
  EXPECT_THAT(pixels(encode<uint16_t>("a.png", 1, {65535, 257 * 100})),
              ElementsAre(255, 255, 255, 255, 100, 100, 100, 255));
}

TEST(Image, every_allowed_format_is_read) {
  const std::vector<uint8_t> rgb = {10, 20, 30, 40, 50, 60};
  for (const char* name : {"a.bmp", "a.tif", "a.tga"}) {
    EXPECT_THAT(pixels(encode<uint8_t>(name, 3, rgb)),
                ElementsAre(10, 20, 30, 255, 40, 50, 60, 255))
        << name;
  }
  const auto webp = pixels(encode<uint8_t>("a.webp", 3, rgb));  // with loss
  ASSERT_EQ(webp.size(), 8u);
  EXPECT_NEAR(webp[0], 10, 5);
  EXPECT_NEAR(webp[6], 60, 5);
  const auto jpeg = pixels(encode<uint8_t>("a.jpg", 3, std::vector<uint8_t>(3 * 64, 90), 8, 8));
  ASSERT_EQ(jpeg.size(), 4u * 64);
  EXPECT_NEAR(jpeg[0], 90, 2);
  const auto gif = pixels(encode<uint8_t>("a.gif", 3, std::vector<uint8_t>(3 * 64, 90), 8, 8));
  ASSERT_EQ(gif.size(), 4u * 64);
}

// OpenImageIO writes no DDS: a header of 128 bytes and one BC1 block, all of whose pixels are red.
TEST(Image, dds_is_read) {
  Bytes dds(128 + 8);
  const auto put = [&](size_t at, uint32_t value) {
    for (size_t i = 0; i < 4; ++i) dds[at + i] = static_cast<uint8_t>(value >> (8 * i));
  };
  put(0, 0x20534444);    // "DDS "
  put(4, 124);           // bytes of the header
  put(8, 0x1007);        // flags: caps, height, width, pixel format
  put(12, 4);            // height
  put(16, 4);            // width
  put(76, 32);           // bytes of the pixel format
  put(80, 4);            // has a code of four letters
  put(84, 0x31545844);   // "DXT1"
  put(108, 0x1000);      // caps: texture
  put(128, 0xf800f800);  // both end points, R5 G6 B5
  const std::vector<uint8_t> rgba = pixels(dds);
  ASSERT_EQ(rgba.size(), 4u * 16);
  EXPECT_THAT(std::vector<uint8_t>(rgba.begin(), rgba.begin() + 4), ElementsAre(255, 0, 0, 255));
}

TEST(Image, radiance_images_are_clamped_and_encoded) {
  const auto rgba = pixels(encode<float>("a.hdr", 3, {4.0f, 1.0f, 0.0f, 0.2158605f, 0.0f, 0.0f}));
  ASSERT_EQ(rgba.size(), 8u);
  EXPECT_EQ(rgba[0], 255);
  EXPECT_EQ(rgba[2], 0);
  EXPECT_NEAR(rgba[4], 128, 2);
}

TEST(Image, every_truncation_of_a_png_is_refused_or_read) {
  const Bytes png = encode<uint8_t>("a.png", 3, std::vector<uint8_t>(3 * 256, 77), 16, 16);
  for (size_t size = 0; size < png.size(); ++size) {
    const auto image = decode_image("a.png", std::span(png).first(size));
    EXPECT_TRUE(!image || image->rgba.size() == 4u * 256) << size;
  }
}

TEST(Image, other_bytes_are_refused_with_the_list_of_formats) {
  EXPECT_EQ(error({'h', 'e', 'l', 'l', 'o'}),
            "unsupported-media-type: a.png: not an image that voxeld reads: expected PNG, JPEG, "
            "TGA, BMP, DDS, WebP, HDR, TIFF or GIF, got \"hello\"");
  // Formats that Debian's library could read, with readers that nobody should meet.
  EXPECT_THAT(error({'8', 'B', 'P', 'S', 0, 1}), HasSubstr("unsupported-media-type"));
  EXPECT_THAT(error({0x76, 0x2f, 0x31, 0x01}), HasSubstr("unsupported-media-type"));
}

TEST(Image, a_broken_image_is_malformed) {
  EXPECT_THAT(error({0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'}),
              HasSubstr("malformed-image: a.png: "));
}

TEST(Image, size_is_refused_before_pixels_are_decoded) {
  // A PNG header of 20000 x 20000 pixels; its check sum is right.
  const Bytes png = encode<uint8_t>("a.png", 1, std::vector<uint8_t>(9000 * 9000, 0), 9000, 9000);
  EXPECT_EQ(error(png),
            "payload-too-large: a.png: the image is too large: expected at most 67108864 pixels, "
            "32768 to a side, got 9000 x 9000 pixels");
}

TEST(Image, one_that_is_cancelled_is_not_decoded_to_its_end) {
  const Bytes png = encode<uint8_t>("a.png", 1, {7, 9});
  std::atomic<bool> is_cancelled{true};
  const CancelScope scope(is_cancelled);
  EXPECT_THROW((void)decode_image("a.png", png).ok(), Cancelled);
  is_cancelled = false;
  EXPECT_TRUE(decode_image("a.png", png));
}

// 5 megapixels at a time, and those of several pieces.
TEST(Image, an_image_of_many_pieces_comes_back) {
  std::vector<uint8_t> grey(size_t{2000} * 2500);
  for (size_t i = 0; i < grey.size(); ++i) grey[i] = static_cast<uint8_t>(i * i >> 7);
  const auto image = decode_image("a.png", encode<uint8_t>("a.png", 1, grey, 2000, 2500));
  ASSERT_TRUE(image) << image.error().message();
  for (size_t i = 0; i < grey.size(); ++i) ASSERT_EQ(image->rgba[4 * i + 1], grey[i]) << i;
}

// A PNG of 8 KB holds 67 megapixels: a scene has one such for nothing.
TEST(PixelBudget, pixels_beyond_the_first_image_are_paid_for_by_bytes) {
  PixelBudget budget;
  EXPECT_TRUE(budget.take("a.png", 8192, 8192, 8229));
  EXPECT_FALSE(budget.is_spent());
  EXPECT_TRUE(budget.take("b.png", 1024, 1024, 4096));
  const Status refused = budget.take("c.png", 8192, 8192, 8229);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kPayloadTooLarge);
  EXPECT_EQ(refused.error().message(),
            "c.png is left out: the textures of one scene have at most 268435456 pixels, and "
            "beyond the first 67108864 at most 256 for each byte of their files");
  EXPECT_TRUE(budget.is_spent());
}

TEST(PixelBudget, large_files_pay_up_to_the_scene_s_limit) {
  PixelBudget budget;
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(budget.take("a.jpg", 8192, 8192, size_t{1} << 33));
  EXPECT_FALSE(budget.take("b.jpg", 1, 1, size_t{1} << 33));
}

TEST(PixelBudget, a_broken_image_is_paid_for) {
  Bytes png = encode<uint8_t>("a.png", 1, std::vector<uint8_t>(size_t{4096} * 4096), 4096, 4096);
  png.resize(png.size() - 40);
  PixelBudget budget;
  int decoded = 0;
  while (!budget.is_spent() && decoded < 100) {
    EXPECT_FALSE(decode_image("a.png", png, &budget));
    ++decoded;
  }
  EXPECT_LT(decoded, 10);
}

}  // namespace
}  // namespace voxeld
