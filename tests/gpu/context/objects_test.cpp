// GL objects: contents, limits, moves.
#include "server/gpu/objects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "tests/gpu/context/test_device.h"

namespace voxeld::gpu {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

TEST(Buffer, is_zeroed_then_holds_the_uploaded_bytes) {
  auto buffer = Buffer::create(test_context(), 64, "test");
  ASSERT_TRUE(buffer.ok()) << buffer.error().message();
  std::vector<uint32_t> words(16, 7);
  buffer->read<uint32_t>(0, words);
  EXPECT_THAT(words, Each(0u));
  const std::vector<uint32_t> three = {1, 2, 3};
  buffer->upload<uint32_t>(8, three);
  buffer->clear(12, 4, 0xabcd);
  buffer->read<uint32_t>(0, words);
  words.resize(6);
  EXPECT_THAT(words, ElementsAre(0, 0, 1, 0xabcd, 3, 0));
  EXPECT_TRUE(test_context().check("test").ok());
}

TEST(Buffer, over_the_storage_limit_is_grid_too_large_with_both_numbers) {
  const int64_t limit = test_context().info().ssbo_bytes_max;
  const auto buffer = Buffer::create(test_context(), static_cast<size_t>(limit) + 4, "bricks");
  ASSERT_FALSE(buffer.ok());
  EXPECT_EQ(buffer.error().code, ErrorCode::kGridTooLarge);
  EXPECT_EQ(buffer.error().message(), "bricks: a buffer is too large for " +
                                          device_name(test_context().info().device) +
                                          ": expected at most " + std::to_string(limit) +
                                          " bytes, got " + std::to_string(limit + 4) + " bytes");
}

TEST(Buffer, moving_leaves_an_empty_one) {
  auto buffer = Buffer::create(test_context(), 16, "test");
  ASSERT_TRUE(buffer.ok());
  Buffer moved = std::move(*buffer);
  EXPECT_NE(moved.id(), 0u);
  EXPECT_EQ(buffer->id(), 0u);
}

TEST(Buffer, ensure_size_keeps_a_buffer_that_is_large_enough) {
  Buffer buffer;
  ASSERT_TRUE(ensure_size(buffer, test_context(), 100, "scratch").ok());
  const uint32_t id = buffer.id();
  ASSERT_TRUE(ensure_size(buffer, test_context(), 50, "scratch").ok());
  EXPECT_EQ(buffer.id(), id);
  ASSERT_TRUE(ensure_size(buffer, test_context(), 101, "scratch").ok());
  EXPECT_EQ(buffer.size_bytes(), 101u);
}

TEST(Texture2D, takes_each_level_and_refuses_a_side_over_the_limit) {
  auto texture = Texture2D::create_rgba8ui(test_context(), 4, 2, 3, "texture");
  ASSERT_TRUE(texture.ok()) << texture.error().message();
  for (int level = 0; level < 3; ++level) {
    const size_t texels = static_cast<size_t>(std::max(1, 4 >> level) * std::max(1, 2 >> level));
    texture->upload_level(level, std::vector<uint8_t>(4 * texels, 9));
  }
  EXPECT_TRUE(test_context().check("texture").ok());
  const int limit = test_context().info().texture_side_max;
  const auto huge = Texture2D::create_rgba8ui(test_context(), limit + 1, 1, 1, "texture");
  ASSERT_FALSE(huge.ok());
  EXPECT_EQ(huge.error().code, ErrorCode::kGridTooLarge);
}

TEST(Framebuffer, colour_targets_are_read_back_by_block) {
  auto target = Framebuffer::create_rgba8(test_context(), 4, 4, "target");
  ASSERT_TRUE(target.ok()) << target.error().message();
  target->bind();
  const GlApi& gl = test_context().gl();
  gl.ClearColor(1, 0, 0, 1);
  gl.Clear(GL_COLOR_BUFFER_BIT);
  gl.Enable(GL_SCISSOR_TEST);
  gl.Scissor(1, 2, 1, 1);
  gl.ClearColor(0, 1, 0, 0);
  gl.Clear(GL_COLOR_BUFFER_BIT);
  gl.Disable(GL_SCISSOR_TEST);
  std::vector<uint8_t> block(8);
  target->read_rgba8(1, 2, 2, 1, block);
  EXPECT_THAT(block, ElementsAre(0, 255, 0, 0, 255, 0, 0, 255));
}

TEST(Framebuffer, without_attachments_and_with_integers_are_complete) {
  EXPECT_TRUE(Framebuffer::create_empty(test_context(), 1024, 512, "empty").ok());
  auto integers = Framebuffer::create_rgba32i(test_context(), 2, 1, "hits");
  ASSERT_TRUE(integers.ok()) << integers.error().message();
  integers->bind();
  const GLint value[4] = {-1, 2, -3, 4};
  test_context().gl().ClearBufferiv(GL_COLOR, 0, value);
  std::vector<int32_t> out(8);
  integers->read_rgba32i(out);
  EXPECT_THAT(out, ElementsAre(-1, 2, -3, 4, -1, 2, -3, 4));
}

TEST(PassTimer, adds_up_passes_of_one_name_in_order_of_first_use) {
  PassTimer timer(test_context());
  for (const char* pass : {"clear", "count", "clear"}) {
    const PassTimer::Pass measured = timer.measure(pass);
  }
  const auto results = timer.results();
  ASSERT_EQ(results.size(), 2u);
  EXPECT_EQ(results[0].first, "clear");
  EXPECT_EQ(results[1].first, "count");
  EXPECT_GE(results[0].second, 0.0);
}

}  // namespace
}  // namespace voxeld::gpu
