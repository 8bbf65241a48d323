// Our own TGA reader: every type and origin, and every way to be broken.
#include "server/scene/images/tga.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/unit/scene_gltf/gltf_builder.h"

namespace voxeld {
namespace {

using ::testing::ElementsAre;

struct Tga {
  uint8_t type = 2, bits = 24, descriptor = 0;
  uint8_t width = 1, height = 1;
  uint8_t palette_first = 0, palette_count = 0, palette_bits = 0;
  Bytes body;

  Bytes bytes() const {
    // Filled by index: GCC 12 sees an overflow in the growth of a vector made from a short list.
    Bytes out(20 + body.size());
    out[0] = 2;  // bytes of the id, which is 0 0
    out[1] = palette_count > 0 ? 1 : 0;
    out[2] = type;
    out[3] = palette_first;
    out[5] = palette_count;
    out[7] = palette_bits;
    out[12] = width;
    out[14] = height;
    out[16] = bits;
    out[17] = descriptor;
    std::copy(body.begin(), body.end(), out.begin() + 20);
    return out;
  }
};

std::vector<uint8_t> tga_pixels(const Tga& tga) {
  const auto image = decode_tga("a.tga", tga.bytes());
  EXPECT_TRUE(image.ok()) << (image ? "" : image.error().message());
  return image ? image->rgba : std::vector<uint8_t>();
}

std::string tga_error(const Bytes& bytes) {
  const auto image = decode_tga("a.tga", bytes);
  if (image) return "ok";
  return std::string(info_of(image.error().code).name) + ": " + image.error().message();
}

TEST(Tga, colour_of_24_and_32_bits) {
  EXPECT_THAT(tga_pixels({.body = {3, 2, 1}}), ElementsAre(1, 2, 3, 255));
  EXPECT_THAT(tga_pixels({.bits = 32, .descriptor = 8, .body = {3, 2, 1, 4}}),
              ElementsAre(1, 2, 3, 4));
  // No bits of alpha: the fourth byte is filling.
  EXPECT_THAT(tga_pixels({.bits = 32, .body = {3, 2, 1, 0}}), ElementsAre(1, 2, 3, 255));
}

TEST(Tga, colour_of_15_and_16_bits) {
  EXPECT_THAT(tga_pixels({.bits = 15, .body = {0x00, 0x7c}}), ElementsAre(255, 0, 0, 255));
  EXPECT_THAT(tga_pixels({.bits = 16, .body = {0xe0, 0x03}}), ElementsAre(0, 255, 0, 255));
  EXPECT_THAT(tga_pixels({.bits = 16, .descriptor = 1, .body = {0x1f, 0x80}}),
              ElementsAre(0, 0, 255, 255));
  EXPECT_THAT(tga_pixels({.bits = 16, .descriptor = 1, .body = {0x1f, 0x00}}),
              ElementsAre(0, 0, 255, 0));
}

TEST(Tga, grey_and_grey_with_alpha) {
  EXPECT_THAT(tga_pixels({.type = 3, .bits = 8, .body = {7}}), ElementsAre(7, 7, 7, 255));
  EXPECT_THAT(tga_pixels({.type = 3, .bits = 16, .descriptor = 8, .body = {7, 9}}),
              ElementsAre(7, 7, 7, 9));
}

TEST(Tga, palettes_that_start_later) {
  const Tga tga{.type = 1,
                .bits = 8,
                .width = 2,
                .palette_first = 5,
                .palette_count = 2,
                .palette_bits = 24,
                .body = {3, 2, 1, 6, 5, 4, 6, 5}};
  EXPECT_THAT(tga_pixels(tga), ElementsAre(4, 5, 6, 255, 1, 2, 3, 255));
}

TEST(Tga, run_lengths_cross_rows) {
  const Tga tga{.type = 11, .bits = 8, .width = 2, .height = 2, .body = {0x82, 9, 0x00, 5}};
  // The origin is the bottom left.
  EXPECT_THAT(tga_pixels(tga), ElementsAre(9, 9, 9, 255, 5, 5, 5, 255, 9, 9, 9, 255, 9, 9, 9, 255));
  EXPECT_THAT(tga_pixels({.type = 10, .width = 2, .body = {0x01, 3, 2, 1, 6, 5, 4}}),
              ElementsAre(1, 2, 3, 255, 4, 5, 6, 255));
  EXPECT_THAT(tga_pixels({.type = 9,
                          .bits = 8,
                          .width = 3,
                          .palette_count = 1,
                          .palette_bits = 24,
                          .body = {3, 2, 1, 0x82, 0}}),
              ElementsAre(1, 2, 3, 255, 1, 2, 3, 255, 1, 2, 3, 255));
}

TEST(Tga, origin_in_each_corner) {
  const auto reds = [](uint8_t descriptor) {
    const std::vector<uint8_t> rgba = tga_pixels({.type = 3,
                                                  .bits = 8,
                                                  .descriptor = descriptor,
                                                  .width = 2,
                                                  .height = 2,
                                                  .body = {1, 2, 3, 4}});
    return std::vector<int>{rgba[0], rgba[4], rgba[8], rgba[12]};
  };
  EXPECT_THAT(reds(0x00), ElementsAre(3, 4, 1, 2));
  EXPECT_THAT(reds(0x10), ElementsAre(4, 3, 2, 1));
  EXPECT_THAT(reds(0x20), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(reds(0x30), ElementsAre(2, 1, 4, 3));
}

TEST(Tga, every_truncation_is_refused) {
  for (const Tga& tga :
       {Tga{.type = 10, .width = 3, .body = {0x81, 3, 2, 1, 0x00, 6, 5, 4}},
        Tga{.type = 1, .bits = 8, .palette_count = 1, .palette_bits = 24, .body = {1, 2, 3, 0}},
        Tga{.bits = 32, .body = {1, 2, 3, 4}}}) {
    const Bytes bytes = tga.bytes();
    EXPECT_EQ(tga_error(bytes), "ok");
    for (size_t size = 0; size < bytes.size(); ++size) {
      EXPECT_NE(tga_error(Bytes(bytes.begin(), bytes.begin() + size)), "ok") << size;
    }
  }
}

TEST(Tga, errors_say_what_and_where) {
  EXPECT_EQ(tga_error({}), "malformed-image: a.tga byte 0: no TGA header");
  EXPECT_EQ(tga_error(Tga{.bits = 9, .body = {0, 0, 0}}.bytes()),
            "malformed-image: a.tga byte 0: no TGA header");
  EXPECT_EQ(tga_error(Tga{.body = {1, 2}}.bytes()),
            "malformed-image: a.tga byte 20: the image is cut off: expected 3 bytes, got 2 bytes");
  EXPECT_EQ(tga_error(Tga{.width = 0, .body = {}}.bytes()),
            "malformed-image: a.tga: the image is empty: expected at least 1 x 1 pixels, got 0 x 1 "
            "pixels");
  EXPECT_EQ(tga_error(Tga{.type = 11, .bits = 8, .width = 2, .body = {0x82, 9}}.bytes()),
            "malformed-image: a.tga byte 20: a packet goes beyond the image: expected at most 2 "
            "pixels, got 3");
  EXPECT_EQ(
      tga_error(Tga{.type = 1,
                    .bits = 8,
                    .palette_first = 1,
                    .palette_count = 1,
                    .palette_bits = 24,
                    .body = {1, 2, 3, 0}}
                    .bytes()),
      "malformed-image: a.tga byte 23: palette index out of range: expected 1 and the 0 after "
      "it, got 0");
}

TEST(Tga, a_small_file_cannot_ask_for_much_memory) {
  Bytes bytes = Tga{.type = 10, .body = {}}.bytes();
  bytes[12] = bytes[14] = 0xff;
  bytes[13] = bytes[15] = 0x1f;
  EXPECT_EQ(tga_error(bytes),
            "malformed-image: a.tga byte 20: the image is cut off: expected 2096644 bytes, got 0 "
            "bytes");
  bytes[13] = bytes[15] = 0xff;
  EXPECT_EQ(tga_error(bytes),
            "payload-too-large: a.tga: the image is too large: expected at most 67108864 pixels, "
            "32768 to a side, got 65535 x 65535 pixels");
}

}  // namespace
}  // namespace voxeld
