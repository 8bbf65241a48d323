// decode_image() compared with OpenImageIO, which writes files and reads the same bytes.
#include "server/scene/images/image.h"

#include <algorithm>
#include <cmath>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <tiff.h>

#include "tests/unit/scene_gltf/image_files.h"

namespace voxeld {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

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

// What OpenImageIO reads, as RGBA. A file name chooses the reader.
Bytes oracle(const char* file_name, const Bytes& bytes) {
  OIIO::Filesystem::IOMemReader memory(const_cast<uint8_t*>(bytes.data()), bytes.size());
  OIIO::ImageSpec config;
  config["oiio:UnassociatedAlpha"] = 1;
  void* proxy = &memory;
  config.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &proxy);
  // ImageInput::open() may read the bytes first, and the DDS reader does not rewind.
  const auto input = OIIO::ImageInput::create(file_name, false, &config, &memory, "");
  memory.seek(0);
  OIIO::ImageSpec spec;
  if (!input || !input->open(file_name, spec, config)) {
    ADD_FAILURE() << (input ? input->geterror() : OIIO::geterror());
    return {};
  }
  const int channels = input->spec().nchannels;
  Bytes packed(static_cast<size_t>(input->spec().image_pixels()) * static_cast<size_t>(channels));
  EXPECT_TRUE(input->read_image(0, 0, 0, channels, OIIO::TypeUInt8, packed.data()))
      << input->geterror();
  Bytes rgba;
  for (size_t i = 0; i < packed.size(); i += static_cast<size_t>(channels)) {
    const bool is_grey = channels < 3;
    rgba.push_back(packed[i]);
    rgba.push_back(packed[i + (is_grey ? 0 : 1)]);
    rgba.push_back(packed[i + (is_grey ? 0 : 2)]);
    rgba.push_back(channels % 2 == 0 ? packed[i + static_cast<size_t>(channels) - 1] : 255);
  }
  return rgba;
}

int largest_difference(const Bytes& a, const Bytes& b) {
  if (a.size() != b.size()) return 256;
  int largest = 0;
  for (size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

std::string error_as_png(const Bytes& bytes) {
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

TEST(Image, png_of_every_kind_is_read_as_by_openimageio) {
  int kinds = 0;
  for (const int type : {0, 2, 3, 4, 6}) {
    for (const int depth : {1, 2, 4, 8, 16}) {
      const bool is_legal = type == 0 || (type == 3 && depth <= 8) || depth >= 8;
      if (!is_legal || (type == 3 && depth == 16)) continue;
      for (const bool interlaced : {false, true}) {
        for (const bool transparent : {false, true}) {
          if (transparent && type >= 4) continue;
          const Bytes png = png_of({type, depth, interlaced, transparent}, 37, 23);
          EXPECT_EQ(largest_difference(pixels(png), oracle("a.png", png)), 0)
              << type << " " << depth << " " << interlaced << " " << transparent;
          ++kinds;
        }
      }
    }
  }
  EXPECT_EQ(kinds, 52);
}

TEST(Image, jpeg_is_read_as_by_openimageio) {
  for (const int channels : {1, 3, 4}) {
    for (const bool progressive : {false, true}) {
      const Bytes jpeg = jpeg_of({channels, progressive}, 40, 27);
      // Products of CMYK are rounded differently.
      EXPECT_LE(largest_difference(pixels(jpeg), oracle("a.jpg", jpeg)), channels == 4 ? 1 : 0)
          << channels << " " << progressive;
    }
  }
}

TEST(Image, tiff_is_read_as_by_openimageio) {
  for (const int channels : {1, 2, 3, 4}) {
    for (const int bits : {8, 16}) {
      for (const int compression :
           {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE, COMPRESSION_PACKBITS}) {
        for (const bool tiled : {false, true}) {
          for (const bool big : {false, true}) {
            const Bytes tiff = tiff_of({channels, bits, compression, tiled, big}, 37, 23);
            EXPECT_EQ(largest_difference(pixels(tiff), oracle("a.tif", tiff)), 0)
                << channels << " " << bits << " " << compression << " " << tiled << " " << big;
          }
        }
      }
    }
  }
}

TEST(Image, dds_blocks_are_read_as_by_openimageio) {
  for (const auto& [letters, bytes] : {std::pair{"DXT1", 8}, {"DXT3", 16}, {"DXT5", 16}}) {
    const Bytes blocks = noise(static_cast<size_t>(bytes) * 64);
    const Bytes dds = dds_of({.width = 32, .height = 32, .letters = letters}, blocks);
    EXPECT_LE(largest_difference(pixels(dds), oracle("a.dds", dds)), 1) << letters;
  }
  const Bytes grey = dds_of({.width = 32, .height = 32, .letters = "ATI1"}, noise(8 * 64));
  EXPECT_LE(largest_difference(pixels(grey), oracle("a.dds", grey)), 1);
}

TEST(Image, gif_and_webp_are_read_as_by_openimageio) {
  for (const bool interlaced : {false, true}) {
    const Bytes gif = gif_of({.is_interlaced = interlaced, .transparent = 3}, noise(37 * 23), 37);
    EXPECT_EQ(largest_difference(pixels(gif), oracle("a.gif", gif)), 0) << interlaced;
  }
  Bytes rgba = noise(4 * 37 * 23);
  // OpenImageIO multiplies by alpha here.
  for (size_t i = 3; i < rgba.size(); i += 4) rgba[i] = 255;
  const Bytes webp = webp_of(rgba, 37);
  EXPECT_EQ(largest_difference(pixels(webp), oracle("a.webp", webp)), 0);
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

TEST(Image, radiance_images_are_clamped_and_encoded) {
  const auto rgba = pixels(encode<float>("a.hdr", 3, {4.0f, 1.0f, 0.0f, 0.2158605f, 0.0f, 0.0f}));
  ASSERT_EQ(rgba.size(), 8u);
  EXPECT_EQ(rgba[0], 255);
  EXPECT_EQ(rgba[2], 0);
  EXPECT_NEAR(rgba[4], 128, 2);
}

TEST(Image, other_bytes_are_refused_with_the_list_of_formats) {
  EXPECT_EQ(error_as_png({'h', 'e', 'l', 'l', 'o'}),
            "unsupported-media-type: a.png: not an image that voxeld reads: expected PNG, JPEG, "
            "TGA, BMP, DDS, WebP, HDR, TIFF or GIF, got \"hello\"");
  // Formats that Debian's library could read, with readers that nobody should meet.
  EXPECT_THAT(error_as_png({'8', 'B', 'P', 'S', 0, 1}), HasSubstr("unsupported-media-type"));
  EXPECT_THAT(error_as_png({0x76, 0x2f, 0x31, 0x01}), HasSubstr("unsupported-media-type"));
}

TEST(Image, a_broken_image_is_malformed) {
  EXPECT_THAT(error_as_png({0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'}),
              HasSubstr("malformed-image: a.png: "));
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
