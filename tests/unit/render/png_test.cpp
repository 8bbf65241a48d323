// encode_png: what another reader gets back.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <random>

#include "server/render/render.h"

namespace voxeld {
namespace {

TEST(EncodePng, keeps_every_level_of_colour_and_straight_alpha) {
  RenderImage image{16, 16, {}};
  for (int i = 0; i < 256; ++i) {
    const auto level = static_cast<uint8_t>(i);
    image.rgba.insert(image.rgba.end(), {level, static_cast<uint8_t>(255 - i), 7, level});
  }
  const auto png = encode_png(image);
  ASSERT_TRUE(png.ok()) << png.error().message();
  ASSERT_GT(png->size(), 8u);
  EXPECT_EQ(std::string(png->begin(), png->begin() + 8), "\x89PNG\r\n\x1a\n");

  OIIO::Filesystem::IOMemReader reader(const_cast<uint8_t*>(png->data()), png->size());
  OIIO::ImageSpec config;
  config.attribute("oiio:UnassociatedAlpha", 1);
  OIIO::Filesystem::IOProxy* proxy = &reader;
  config.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &proxy);
  const auto input = OIIO::ImageInput::open("image.png", &config);
  ASSERT_NE(input, nullptr) << OIIO::geterror();
  EXPECT_EQ(input->spec().width, 16);
  EXPECT_EQ(input->spec().nchannels, 4);
  std::vector<uint8_t> back(image.rgba.size());
  ASSERT_TRUE(input->read_image(0, 0, 0, 4, OIIO::TypeDesc::UINT8, back.data()));
  EXPECT_EQ(back, image.rgba);
}

TEST(EncodePng, noise_fits_into_the_room_that_was_reserved) {
  std::mt19937 random(1);
  RenderImage image{300, 200, {}};
  for (size_t i = 0; i < 4 * 300 * 200; ++i) image.rgba.push_back(static_cast<uint8_t>(random()));
  const auto png = encode_png(image);
  ASSERT_TRUE(png.ok()) << png.error().message();
  EXPECT_GT(png->size(), image.rgba.size());
  EXPECT_LT(png->capacity(), image.rgba.size() + image.rgba.size() / 64);
}

TEST(EncodePng, one_pixel_is_an_image) {
  const auto png = encode_png(RenderImage{1, 1, {1, 2, 3, 4}});
  ASSERT_TRUE(png.ok()) << png.error().message();
}

}  // namespace
}  // namespace voxeld
