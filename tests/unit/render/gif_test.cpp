// Animated images: what another reader gets back.
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <atomic>
#include <string>

#include "server/base/cancel_point.h"
#include "server/base/disk/file.h"
#include "server/render/animated_image.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/render/plain_images.h"

namespace voxeld {
namespace {

TEST(Gif, every_image_is_read_back_with_its_delay_and_loops_for_ever) {
  const testing::TemporaryDir dir;
  const auto path = dir.path() / "four.gif";
  write_all_to(write_gif(path, {0.1, 1.0 / 24, 0.5, 3.0}));
  const auto input = OIIO::ImageInput::open(path.string());
  ASSERT_NE(input, nullptr) << OIIO::geterror();
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(input->seek_subimage(i, 0)) << i;
    const OIIO::ImageSpec spec = input->spec();
    EXPECT_EQ(spec.width, 20);
    EXPECT_EQ(spec.height, 12);
    std::vector<uint8_t> back(size_t{20} * 12 * 4);
    ASSERT_TRUE(input->read_image(i, 0, 0, 4, OIIO::TypeDesc::UINT8, back.data()));
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(back[4 * 100 + c], kColors[static_cast<size_t>(i)][c]) << i;
    }
  }
  EXPECT_FALSE(input->seek_subimage(4, 0));
  const auto bytes = read_file(path);
  ASSERT_TRUE(bytes.ok());
  const std::string text(bytes->begin(), bytes->end());
  const size_t rounds = text.find("NETSCAPE2.0");
  ASSERT_NE(rounds, std::string::npos);
  EXPECT_EQ(text.substr(rounds + 11, 5), std::string("\3\1\0\0\0", 5));  // 0: for ever
  std::vector<int> delays;
  for (size_t at = 0; at + 8 < bytes->size(); ++at) {
    const auto& b = *bytes;
    if (b[at] == 0x21 && b[at + 1] == 0xf9 && b[at + 2] == 4 && b[at + 7] == 0) {
      delays.push_back(b[at + 4] | b[at + 5] << 8);
    }
  }
  EXPECT_EQ(delays, (std::vector<int>{10, 4, 50, 300}));
}

TEST(Gif, transparent_pixels_are_blended_with_white) {
  const testing::TemporaryDir dir;
  const auto path = dir.path() / "one.gif";
  auto writer = write_gif(path, {1.0});
  ASSERT_TRUE(writer.ok());
  ASSERT_TRUE((*writer)->add(plain(8, 8, {0, 0, 0, 0})).ok());
  ASSERT_TRUE((*writer)->finish().ok());
  const auto input = OIIO::ImageInput::open(path.string());
  ASSERT_NE(input, nullptr) << OIIO::geterror();
  std::vector<uint8_t> back(size_t{8} * 8 * 4);
  ASSERT_TRUE(input->read_image(0, 0, 0, 4, OIIO::TypeDesc::UINT8, back.data()));
  for (size_t c = 0; c < 3; ++c) EXPECT_EQ(back[c], 255);
}

// 4096 colours and half of the alphas.
TEST(Gif, many_colours_are_read_back_as_their_dithered_mean) {
  RenderImage image{64, 64, {}};
  for (int i = 0; i < 64 * 64; ++i) {
    const auto x = static_cast<uint8_t>(4 * (i % 64)), y = static_cast<uint8_t>(4 * (i / 64));
    image.rgba.insert(image.rgba.end(), {x, y, 0, static_cast<uint8_t>(i % 2 == 0 ? 255 : 0)});
  }
  const testing::TemporaryDir dir;
  const auto path = dir.path() / "many.gif";
  auto writer = write_gif(path, {1.0, 1.0});
  ASSERT_TRUE(writer.ok());
  for (int i = 0; i < 2; ++i) ASSERT_TRUE((*writer)->add(image).ok());
  ASSERT_TRUE((*writer)->finish().ok());
  const auto input = OIIO::ImageInput::open(path.string());
  ASSERT_NE(input, nullptr) << OIIO::geterror();
  ASSERT_TRUE(input->seek_subimage(1, 0));
  std::vector<uint8_t> back(size_t{64} * 64 * 4);
  ASSERT_TRUE(input->read_image(1, 0, 0, 4, OIIO::TypeDesc::UINT8, back.data()));
  for (size_t c = 0; c < 3; ++c) {
    int wanted = 0, got = 0;
    for (size_t i = 0; i < size_t{64} * 64; ++i) {
      wanted += image.rgba[4 * i + 3] == 255 ? image.rgba[4 * i + c] : 255;
      got += back[4 * i + c];
    }
    EXPECT_NEAR(wanted / 4096.0, got / 4096.0, 1.0) << c;
  }
}

TEST(Gif, a_file_that_cannot_be_made_is_an_error) {
  const auto writer = write_gif("/nowhere/a.gif", {1.0});
  ASSERT_FALSE(writer.ok());
  EXPECT_NE(writer.error().message().find("create a.gif: No such file"), std::string::npos);
}

TEST(Gif, a_cancelled_image_is_not_encoded) {
  const testing::TemporaryDir dir;
  auto writer = write_gif(dir.path() / "one.gif", {1.0});
  ASSERT_TRUE(writer.ok());
  std::atomic<bool> cancelled{true};
  const CancelScope scope(cancelled);
  EXPECT_THROW((void)(*writer)->add(plain(8, 8, {1, 2, 3, 255})).ok(), Cancelled);
}

TEST(Apng, a_reader_that_knows_no_animation_sees_the_first_image) {
  const testing::TemporaryDir dir;
  const auto path = dir.path() / "four.png";
  write_all_to(write_apng(path, {0.1, 0.1, 0.1, 0.1}));
  const auto input = OIIO::ImageInput::open(path.string());
  ASSERT_NE(input, nullptr) << OIIO::geterror();
  std::vector<uint8_t> back(size_t{20} * 12 * 4);
  ASSERT_TRUE(input->read_image(0, 0, 0, 4, OIIO::TypeDesc::UINT8, back.data()));
  EXPECT_EQ(back, plain(20, 12, kColors[0]).rgba);
}

}  // namespace
}  // namespace voxeld
