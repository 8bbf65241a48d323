// DDS: every form that is read, and the texts of those that are not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/scene/images/image.h"
#include "tests/unit/scene_gltf/image_files.h"

namespace voxeld {
namespace {

using ::testing::ElementsAre;

std::string dds_error(const Bytes& bytes) {
  const auto image = decode_image("a", bytes);
  if (image) return "ok";
  return std::string(info_of(image.error().code).name) + ": " + image.error().message();
}

Bytes pixel(const Bytes& rgba, size_t number) {
  return Bytes(rgba.begin() + static_cast<ptrdiff_t>(4 * number),
               rgba.begin() + static_cast<ptrdiff_t>(4 * number + 4));
}

// Two end points of R5 G6 B5: red and blue. Pixels 0 and 1 have them, 2 and 3 are a third and two
// thirds of the way. If the first number is the smaller one, 2 is the mean, and 3 is transparent.
const Bytes kRedBlue = {0x00, 0xf8, 0x1f, 0x00, 0b11100100, 0, 0, 0};
const Bytes kBlueRed = {0x1f, 0x00, 0x00, 0xf8, 0b11100100, 0, 0, 0};

Bytes both(Bytes first, const Bytes& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

TEST(Dds, bc1_has_two_forms) {
  const Bytes opaque = pixels(dds_of({.letters = "DXT1"}, kRedBlue));
  ASSERT_EQ(opaque.size(), 64u);
  EXPECT_THAT(pixel(opaque, 0), ElementsAre(255, 0, 0, 255));
  EXPECT_THAT(pixel(opaque, 1), ElementsAre(0, 0, 255, 255));
  EXPECT_THAT(pixel(opaque, 2), ElementsAre(170, 0, 85, 255));
  EXPECT_THAT(pixel(opaque, 3), ElementsAre(85, 0, 170, 255));
  const Bytes clear = pixels(dds_of({.letters = "DXT1"}, kBlueRed));
  EXPECT_THAT(pixel(clear, 2), ElementsAre(128, 0, 128, 255));
  EXPECT_THAT(pixel(clear, 3), ElementsAre(0, 0, 0, 0));
}

TEST(Dds, bc2_has_four_bits_of_alpha) {
  const Bytes block = both({0xf0, 0x08, 0, 0, 0, 0, 0, 0}, kRedBlue);
  const Bytes rgba = pixels(dds_of({.letters = "DXT3"}, block));
  EXPECT_THAT(pixel(rgba, 0), ElementsAre(255, 0, 0, 0));
  EXPECT_THAT(pixel(rgba, 1), ElementsAre(0, 0, 255, 255));
  EXPECT_THAT(pixel(rgba, 2), ElementsAre(170, 0, 85, 136));
}

// 255 and 0, then steps of a seventh between them.
const Bytes kRamp = {255, 0, 0b11010000, 0, 0, 0, 0, 0};  // pixels 0, 2, 3

TEST(Dds, bc3_has_a_ramp_of_alpha) {
  const Bytes rgba = pixels(dds_of({.letters = "DXT5"}, both(kRamp, kRedBlue)));
  EXPECT_THAT(pixel(rgba, 0), ElementsAre(255, 0, 0, 255));
  EXPECT_THAT(pixel(rgba, 1), ElementsAre(0, 0, 255, 219));
  EXPECT_THAT(pixel(rgba, 2), ElementsAre(170, 0, 85, 182));
}

TEST(Dds, colours_multiplied_by_alpha_are_divided) {
  const Bytes rgba = pixels(dds_of({.letters = "DXT4"}, both(kRamp, kRedBlue)));
  EXPECT_THAT(pixel(rgba, 2), ElementsAre(238, 0, 119, 182));
}

TEST(Dds, bc4_is_grey_and_bc5_red_and_green) {
  for (const char* letters : {"ATI1", "BC4U"}) {
    const Bytes grey = pixels(dds_of({.letters = letters}, kRamp));
    EXPECT_THAT(pixel(grey, 0), ElementsAre(255, 255, 255, 255)) << letters;
    EXPECT_THAT(pixel(grey, 1), ElementsAre(219, 219, 219, 255)) << letters;
  }
  const Bytes flat = {9, 9, 0, 0, 0, 0, 0, 0};
  for (const char* letters : {"ATI2", "BC5U"}) {
    const Bytes two = pixels(dds_of({.letters = letters}, both(kRamp, flat)));
    EXPECT_THAT(pixel(two, 0), ElementsAre(255, 9, 0, 255)) << letters;
    EXPECT_THAT(pixel(two, 1), ElementsAre(219, 9, 0, 255)) << letters;
  }
}

TEST(Dds, blocks_at_the_edges_are_cut) {
  const Bytes rgba =
      pixels(dds_of({.width = 5, .height = 1, .letters = "DXT1"}, both(kRedBlue, kBlueRed)));
  ASSERT_EQ(rgba.size(), 20u);
  EXPECT_THAT(pixel(rgba, 0), ElementsAre(255, 0, 0, 255));
  EXPECT_THAT(pixel(rgba, 4), ElementsAre(0, 0, 255, 255));
}

TEST(Dds, numbers_of_every_size_are_read_by_their_masks) {
  const auto one = [](uint32_t flags, uint32_t bits, std::vector<uint32_t> masks, Bytes bytes) {
    return pixels(dds_of(
        {.width = 1, .height = 1, .flags = flags, .bits = bits, .masks = std::move(masks)}, bytes));
  };
  const std::vector<uint32_t> bgra = {0xff0000, 0xff00, 0xff, 0xff000000};
  EXPECT_THAT(one(0x41, 32, bgra, {3, 2, 1, 4}), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(one(0x40, 32, bgra, {3, 2, 1, 4}), ElementsAre(1, 2, 3, 255));
  EXPECT_THAT(one(0x40, 24, {0xff0000, 0xff00, 0xff, 0}, {3, 2, 1}), ElementsAre(1, 2, 3, 255));
  EXPECT_THAT(one(0x40, 16, {0xf800, 0x7e0, 0x1f, 0}, {0xe0, 0xff}), ElementsAre(255, 255, 0, 255));
  EXPECT_THAT(one(0x41, 16, {0xf00, 0xf0, 0xf, 0xf000}, {0x21, 0x43}), ElementsAre(51, 34, 17, 68));
  EXPECT_THAT(one(0x41, 16, {0x7c00, 0x3e0, 0x1f, 0x8000}, {0x1f, 0x00}),
              ElementsAre(0, 0, 255, 0));
  EXPECT_THAT(one(0x20000, 8, {0xff, 0, 0, 0}, {7}), ElementsAre(7, 7, 7, 255));
  EXPECT_THAT(one(0x20001, 16, {0xff, 0, 0, 0xff00}, {7, 9}), ElementsAre(7, 7, 7, 9));
}

TEST(Dds, dx10_formats) {
  const auto one = [](uint32_t dxgi, const Bytes& bytes) {
    const Bytes rgba =
        pixels(dds_of({.width = 1, .height = 1, .letters = "DX10", .dxgi = dxgi}, bytes));
    return rgba.empty() ? rgba : pixel(rgba, 0);
  };
  const Bytes four = {1, 2, 3, 4};
  for (const uint32_t dxgi : {28u, 29u}) EXPECT_THAT(one(dxgi, four), ElementsAre(1, 2, 3, 4));
  for (const uint32_t dxgi : {87u, 91u}) EXPECT_THAT(one(dxgi, four), ElementsAre(3, 2, 1, 4));
  for (const uint32_t dxgi : {88u, 93u}) EXPECT_THAT(one(dxgi, four), ElementsAre(3, 2, 1, 255));
  EXPECT_THAT(one(49, {1, 2}), ElementsAre(1, 2, 0, 255));
  EXPECT_THAT(one(61, {1}), ElementsAre(1, 1, 1, 255));
  EXPECT_THAT(one(85, {0x00, 0xf8}), ElementsAre(255, 0, 0, 255));
  EXPECT_THAT(one(86, {0x00, 0x7c}), ElementsAre(255, 0, 0, 0));
  EXPECT_THAT(one(115, {0x21, 0x43}), ElementsAre(51, 34, 17, 68));
  for (const uint32_t dxgi : {71u, 72u}) {
    EXPECT_THAT(one(dxgi, kRedBlue), ElementsAre(255, 0, 0, 255));
  }
  for (const uint32_t dxgi : {74u, 75u}) {
    EXPECT_THAT(one(dxgi, both({15, 0, 0, 0, 0, 0, 0, 0}, kRedBlue)), ElementsAre(255, 0, 0, 255));
  }
  for (const uint32_t dxgi : {77u, 78u}) {
    EXPECT_THAT(one(dxgi, both(kRamp, kRedBlue)), ElementsAre(255, 0, 0, 255));
  }
  EXPECT_THAT(one(80, kRamp), ElementsAre(255, 255, 255, 255));
  EXPECT_THAT(one(83, both(kRamp, kRamp)), ElementsAre(255, 255, 0, 255));
}

TEST(Dds, every_truncation_is_refused) {
  for (const Bytes& dds :
       {dds_of({.letters = "DXT1"}, kRedBlue),
        dds_of({.letters = "DX10", .dxgi = 77}, both(kRamp, kRedBlue)),
        dds_of({.flags = 0x40, .bits = 16, .masks = {0xf800, 0x7e0, 0x1f, 0}}, Bytes(32))}) {
    EXPECT_EQ(dds_error(dds), "ok");
    for (size_t size = 0; size < dds.size(); ++size) {
      const Bytes cut(dds.begin(), dds.begin() + static_cast<ptrdiff_t>(size));
      EXPECT_NE(dds_error(cut), "ok") << size;
    }
  }
  EXPECT_EQ(dds_error(dds_of({.letters = "DXT5"}, kRamp)),
            "malformed-image: a: the image is cut off: expected at least 144 bytes, got 136 bytes");
}

TEST(Dds, other_pixels_are_named) {
  const std::string begin =
      "unsupported-feature: a: pixels of the DDS: expected BC1 to BC5 without signs, or RGB, RGBA "
      "or grey of up to 8 bits a channel, got ";
  EXPECT_EQ(dds_error(dds_of({.letters = "DX10", .dxgi = 98}, Bytes(16))), begin + "BC7");
  EXPECT_EQ(dds_error(dds_of({.letters = "DX10", .dxgi = 95}, Bytes(16))), begin + "BC6H");
  EXPECT_EQ(dds_error(dds_of({.letters = "DX10", .dxgi = 84}, Bytes(16))),
            begin + "BC5 with signs");
  EXPECT_EQ(dds_error(dds_of({.letters = "DX10", .dxgi = 2}, Bytes(256))), begin + "DXGI format 2");
  EXPECT_EQ(dds_error(dds_of({.letters = "DX10", .dxgi = 28, .dimension = 4}, Bytes(64))),
            begin + "DXGI dimension 4");
  EXPECT_EQ(dds_error(dds_of({.letters = "BC4S"}, Bytes(8))), begin + "\"BC4S\"");
  EXPECT_EQ(dds_error(dds_of({.flags = 0x200, .bits = 16}, Bytes(32))), begin + "flags 512");
  EXPECT_EQ(dds_error(dds_of({.flags = 0x40, .bits = 12}, Bytes(32))), begin + "12 bits a pixel");
  EXPECT_EQ(dds_error(dds_of({.flags = 0x40, .bits = 32, .masks = {0x3ff, 0, 0, 0}}, Bytes(64))),
            begin + "the mask 1023 in 32 bits");
  EXPECT_EQ(dds_error(dds_of({.flags = 0x40, .bits = 16, .masks = {0xff0000, 0, 0, 0}}, Bytes(32))),
            begin + "the mask 16711680 in 16 bits");
  Bytes volume = dds_of({.letters = "DXT1"}, kRedBlue);
  volume[114] = 0x20;
  EXPECT_EQ(dds_error(volume), begin + "a volume");
  Bytes header = dds_of({.letters = "DXT1"}, kRedBlue);
  header[4] = 1;
  EXPECT_EQ(dds_error(header),
            "malformed-image: a: the DDS header has other sizes than 124 and 32 bytes");
}

}  // namespace
}  // namespace voxeld
