// Options by type: their texts, and that the daemon's parser reads them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/include/voxeld/client.h"
#include "proto/options/options.h"

namespace voxeld::client {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

RequestOptions parsed(const Options& options, OptionScope scope) {
  const auto result = parse_options(options.pairs(), scope);
  EXPECT_TRUE(result.ok()) << result.error().message();
  return result.ok() ? *result : RequestOptions();
}

TEST(Options, typed_and_named_ones_are_the_same_and_the_last_one_counts) {
  const Options options = Options()
                              .set("size", "7")
                              .size(256)
                              .fill(Fill::kShell)
                              .set("fill", "solid")
                              .set("of-a-newer-daemon", "1");
  EXPECT_THAT(options.pairs(), ElementsAre(Pair("size", "256"), Pair("fill", "solid"),
                                           Pair("of-a-newer-daemon", "1")));
}

TEST(Options, each_kind_of_value_has_its_text) {
  const Options options = Options()
                              .priority(-3)
                              .deadline(std::chrono::minutes(1))
                              .dims({64, 32, 16})
                              .voxel_size(0.1)
                              .bounds({-1, 0, 0.5, 1, 2, 1e-7})
                              .channels({Channel::kColor, Channel::kLabel})
                              .crop(true)
                              .cache(false)
                              .mirror({Axis::kX, Axis::kZ})
                              .blocks({"concrete", "minecraft:stone"})
                              .animation("walk")
                              .frames(3, 17)
                              .times({0, 0.25})
                              .palette(16)
                              .keep("largest")
                              .neighbors(Neighbors::k18)
                              .remap({{1, 2}, {7, 1}})
                              .samples(Samples::k2)
                              .dtype(DType::kFloat32);
  EXPECT_THAT(
      options.pairs(),
      ElementsAre(Pair("priority", "-3"), Pair("deadline_ms", "60000"), Pair("dims", "64,32,16"),
                  Pair("voxel_size", "0.1"), Pair("bounds", "-1,0,0.5,1,2,1e-07"),
                  Pair("channels", "color,label"), Pair("crop", "yes"), Pair("cache", "no"),
                  Pair("mirror", "x,z"), Pair("blocks", "concrete,minecraft:stone"),
                  Pair("animation", "walk"), Pair("frames", "3..17"), Pair("times", "0,0.25"),
                  Pair("palette", "16"), Pair("keep", "largest"), Pair("neighbors", "18"),
                  Pair("remap", "1:2,7:1"), Pair("samples", "2"), Pair("dtype", "float32")));
}

TEST(Options, the_daemon_reads_what_the_setters_write) {
  const RequestOptions grid = parsed(Options()
                                         .voxel_size({0.5, 0.25, 1})
                                         .up(UpAxis::kZ)
                                         .fill(Fill::kBand)
                                         .thickness(2.5)
                                         .channels({Channel::kDistance, Channel::kLabel})
                                         .labels(LabelKind::kGroup)
                                         .keep(3)
                                         .remap({{1, 2}})
                                         .region({0, 0, 0, 8, 8, 8})
                                         .level_rule(LevelRule::kMajority)
                                         .level(1),
                                     OptionScope::kVoxelize);
  EXPECT_EQ(grid.voxelize.placement.voxel_size, (std::array<double, 3>{0.5, 0.25, 1}));
  EXPECT_EQ(grid.voxelize.placement.up, voxeld::UpAxis::kZ);
  EXPECT_EQ(grid.voxelize.fill, voxeld::Fill::kBand);
  EXPECT_EQ(grid.voxelize.thickness, 2.5);
  EXPECT_TRUE(grid.voxelize.channels->label && grid.voxelize.channels->distance);
  EXPECT_EQ(grid.output.keep, 3);
  EXPECT_EQ(grid.output.remap, (std::vector<LabelChange>{{1, 2}}));
  EXPECT_EQ(grid.output.level, 1);
  const RequestOptions image = parsed(Options()
                                          .animation(0)
                                          .frames(7)
                                          .style(Style::kClay)
                                          .shadow(false)
                                          .background("transparent")
                                          .section({0, 1, 0, -0.5})
                                          .renderer(Renderer::kCpu),
                                      OptionScope::kRenderMesh);
  EXPECT_EQ(image.animation.frames, (std::array<int, 2>{7, 7}));
  EXPECT_EQ(image.render.style, voxeld::Style::kClay);
  EXPECT_FALSE(image.render.shadow);
  EXPECT_EQ(image.render.section, (std::array<double, 4>{0, 1, 0, -0.5}));
}

template <typename Value>
concept IsYesOrNo = requires(Options options, Value value) {
  options.crop(value);
};
static_assert(IsYesOrNo<bool>);
static_assert(!IsYesOrNo<const char*>);  // "no" would be true

}  // namespace
}  // namespace voxeld::client
