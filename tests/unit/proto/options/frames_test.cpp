// Options of animations and of images that show several grids: what goes together, and the
// canonical text. Values of single options are in options_test.cpp.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "proto/limits.h"
#include "proto/options/options.h"
#include "tests/unit/proto/options/parsed_options.h"

namespace voxeld {
namespace {

using test::parsed;

constexpr auto kVoxelize = OptionScope::kVoxelize;
constexpr auto kRenderMesh = OptionScope::kRenderMesh;
constexpr auto kRenderGrid = OptionScope::kRenderGrid;
constexpr auto kExport = OptionScope::kExport;

std::string refusal_text(const OptionPairs& pairs, OptionScope scope) {
  const auto options = parse_options(pairs, scope);
  EXPECT_FALSE(options) << pairs[0].first;
  if (options) return "";
  EXPECT_EQ(options.error().code, ErrorCode::kInvalidOption);
  return options.error().message();
}
std::string canonical(const OptionPairs& pairs, OptionScope scope) {
  return canonical_json(parsed(pairs, scope), scope);
}
std::string again(const std::string& text, OptionScope scope) {
  const auto options = parse_options(nlohmann::json::parse(text), scope);
  EXPECT_TRUE(options) << text << (options ? "" : options.error().message());
  return options ? canonical_json(*options, scope) : "";
}

TEST(AnimationOptions, reach_their_fields) {
  const AnimationOptions even =
      parsed(
          {{"animation", "walk"}, {"frames", "3..12"}, {"fps", "23.976"}, {"root_motion", "strip"}},
          kVoxelize)
          .animation;
  EXPECT_EQ(even.animation, "walk");
  EXPECT_EQ(even.frames, (std::array<int, 2>{3, 12}));
  EXPECT_EQ(even.fps, 23.976);
  EXPECT_EQ(even.root_motion, RootMotionChoice::kStrip);
  EXPECT_TRUE(even.is_sequence());
  EXPECT_EQ(parsed({{"frames", "12"}}, kVoxelize).animation.frames, (std::array<int, 2>{12, 12}));
  EXPECT_EQ(parsed({{"times", "0,0.5,2"}}, kRenderMesh).animation.times_s,
            (std::vector<double>{0, 0.5, 2}));
  const AnimationOptions still = parsed({{"time", "1.5"}}, kVoxelize).animation;
  EXPECT_EQ(still.time_s, 1.5);
  EXPECT_TRUE(still.moves());
  EXPECT_FALSE(still.is_sequence());
  EXPECT_FALSE(parsed({}, kVoxelize).animation.moves());
}

TEST(AnimationOptions, one_time_excludes_several_and_given_times_exclude_even_ones) {
  for (const auto& [name, value] : {std::pair{"frames", "0..3"}, {"fps", "24"}, {"times", "0,1"}}) {
    EXPECT_EQ(
        refusal_text({{"time", "1"}, {name, value}}, kVoxelize),
        "time: expected neither frames, fps nor times with it, got \"" + std::string(name) + "\"");
  }
  for (const auto& [name, value] : {std::pair{"frames", "0..3"}, {"fps", "24"}}) {
    EXPECT_EQ(refusal_text({{"times", "0,1"}, {name, value}}, kRenderMesh),
              "times: expected neither frames nor fps with it, got \"" + std::string(name) + "\"");
  }
}

TEST(AnimationOptions, root_motion_alone_says_nothing) {
  EXPECT_EQ(refusal_text({{"root_motion", "strip"}}, kVoxelize),
            "root_motion: expected animation, time, frames, fps or times with it, got \"none of "
            "them\"");
  for (const auto& [name, value] :
       {std::pair{"animation", "0"}, {"time", "1"}, {"fps", "24"}, {"times", "1"}}) {
    EXPECT_EQ(parsed({{name, value}, {"root_motion", "strip"}}, kVoxelize).animation.root_motion,
              RootMotionChoice::kStrip);
  }
}

TEST(AnimationOptions, the_number_of_frames_has_a_limit) {
  EXPECT_EQ(refusal_text({{"frames", "10..4106"}}, kVoxelize),
            "frames: expected at most 4096 of them, got \"10..4106\"");
  std::string times = "0";
  for (int i = 1; i < limits::kFramesMax; ++i) times += "," + std::to_string(i);
  EXPECT_EQ(parsed({{"times", times}}, kVoxelize).animation.times_s.size(), 4096u);
  EXPECT_EQ(refusal_text({{"times", times + ",9999"}}, kVoxelize),
            "times: expected at most 4096 times, got \"4097\"");
}

TEST(AnimationOptions, a_sequence_takes_only_frames) {
  for (const OptionScope scope : {kExport, kRenderGrid}) {
    EXPECT_EQ(parsed({{"frames", "1..2"}}, scope).animation.frames, (std::array<int, 2>{1, 2}));
    for (const char* name : {"animation", "time", "fps", "times", "root_motion"}) {
      const auto options = parse_options(OptionPairs{{name, "1"}}, scope);
      ASSERT_FALSE(options);
      EXPECT_EQ(options.error().code, ErrorCode::kUnknownOption) << name;
    }
  }
}

TEST(AnimationOptions, canonical_text_names_nothing_where_nothing_moves) {
  for (const OptionScope scope : {kVoxelize, kRenderMesh, kRenderGrid, kExport}) {
    const auto text = nlohmann::json::parse(canonical({}, scope));
    for (const char* name : {"animation", "time", "frames", "fps", "times", "root_motion", "image",
                             "frame", "turntable", "rate", "columns"}) {
      EXPECT_FALSE(text.contains(name)) << name;
    }
  }
}

TEST(AnimationOptions, canonical_text_spells_out_set_options) {
  const auto ends_with = [](const OptionPairs& pairs, OptionScope scope, const std::string& part) {
    const std::string text = canonical(pairs, scope);
    EXPECT_NE(text.find(part), std::string::npos) << text;
    EXPECT_EQ(again(text, scope), text);
  };
  ends_with({{"animation", "0"}}, kVoxelize,
            R"("pipeline":"auto","animation":"0","root_motion":"keep","format":"native")");
  ends_with({{"frames", "7"}, {"fps", "2.5e1"}}, kRenderMesh,
            R"("frames":"7..7","fps":25,"root_motion":"keep","width":512)");
  ends_with({{"times", "0,.5,1e0"}, {"root_motion", "strip"}}, kVoxelize,
            R"("times":[0,0.5,1],"root_motion":"strip")");
  ends_with({{"animation", "a \"b\" \xc3\xa9"}, {"time", "0.5"}}, kVoxelize,
            R"("animation":"a \"b\" )"
            "\xc3\xa9"
            R"(","time":0.5,"root_motion":"keep")");
  ends_with({{"frames", "0..3"}}, kExport, R"({"frames":"0..3","format":"native")");
  ends_with({{"frames", "0..3"}, {"image", "sheet"}, {"columns", "2"}}, kRenderGrid,
            R"("image":"sheet","columns":2})");
  ends_with({{"image", "gif"}, {"turntable", "36"}, {"rate", "12.5"}}, kRenderGrid,
            R"("renderer":"auto","image":"gif","turntable":36,"rate":12.5})");
  ends_with({{"frame", "3"}, {"level", "1"}}, kRenderGrid,
            R"("frame":3,"level":1,"level_rule":"any"})");
}

TEST(AnimationOptions, requests_that_differ_have_other_texts) {
  const std::vector<OptionPairs> requests = {
      {},
      {{"animation", "0"}},
      {{"animation", "walk"}},
      {{"animation", "0"}, {"time", "0"}},
      {{"animation", "0"}, {"frames", "0"}},
      {{"animation", "0"}, {"frames", "0..1"}},
      {{"animation", "0"}, {"fps", "24"}},
      {{"animation", "0"}, {"times", "0"}},
      {{"animation", "0"}, {"root_motion", "strip"}},
  };
  std::set<std::string> texts;
  for (const OptionPairs& pairs : requests) texts.insert(canonical(pairs, kVoxelize));
  EXPECT_EQ(texts.size(), requests.size());
}

TEST(AnimationOptions, json_takes_numbers_and_lists) {
  const auto options =
      parse_options(nlohmann::json::parse(R"({"animation": 2, "times": [0, 0.25, 3]})"), kVoxelize);
  ASSERT_TRUE(options) << options.error().message();
  EXPECT_EQ(options->animation.animation, "2");
  EXPECT_EQ(options->animation.times_s, (std::vector<double>{0, 0.25, 3}));
}

TEST(ImageOptions, reach_their_fields) {
  const RenderOptions gif =
      parsed({{"image", "gif"}, {"turntable", "36"}, {"rate", "12"}}, kRenderGrid).render;
  EXPECT_EQ(gif.image, ImageKind::kGif);
  EXPECT_EQ(gif.turntable, 36);
  EXPECT_EQ(gif.rate, 12);
  EXPECT_EQ(gif.width, 512);
  const RenderOptions sheet = parsed({{"image", "sheet"}, {"columns", "4"}}, kRenderGrid).render;
  EXPECT_EQ(sheet.columns, 4);
  EXPECT_EQ(parsed({{"frame", "3"}}, kRenderGrid).render.frame, 3);
}

TEST(ImageOptions, images_of_a_sheet_are_small_where_nothing_else_is_said) {
  const RenderOptions sheet = parsed({{"image", "sheet"}}, kRenderGrid).render;
  EXPECT_EQ(sheet.width, 160);
  EXPECT_EQ(sheet.height, 160);
  const RenderOptions wide = parsed({{"width", "300"}, {"image", "sheet"}}, kRenderGrid).render;
  EXPECT_EQ(wide.width, 300);
  EXPECT_EQ(wide.height, 160);
}

TEST(ImageOptions, apply_to_some_images_alone) {
  EXPECT_EQ(refusal_text({{"rate", "5"}}, kRenderGrid),
            "rate: expected image gif or apng with it, got \"png\"");
  EXPECT_EQ(refusal_text({{"rate", "5"}, {"image", "sheet"}}, kRenderGrid),
            "rate: expected image gif or apng with it, got \"sheet\"");
  EXPECT_EQ(refusal_text({{"columns", "5"}, {"image", "apng"}}, kRenderGrid),
            "columns: expected image sheet with it, got \"apng\"");
  EXPECT_EQ(refusal_text({{"turntable", "5"}}, kRenderGrid),
            "turntable: expected image gif, apng or sheet with it, got \"png\"");
  EXPECT_EQ(refusal_text({{"frame", "5"}, {"image", "gif"}}, kRenderGrid),
            "frame: expected image png with it, got \"gif\"");
  EXPECT_EQ(
      refusal_text(
          {{"image", "gif"}, {"turntable", "5"}, {"matrix", "1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1"}},
          kRenderGrid),
      "turntable: expected a camera without matrix, got \"matrix\"");
}

TEST(ImageOptions, images_of_a_mesh_need_frames_or_a_turntable) {
  for (const char* image : {"gif", "apng", "sheet"}) {
    EXPECT_EQ(parsed({{"image", image}}, kRenderMesh).animation.animation, "0");
    EXPECT_EQ(refusal_text({{"image", image}, {"time", "1"}}, kRenderMesh),
              "image: expected frames of an animation, or turntable with it, got \"" +
                  std::string(image) + "\"");
    EXPECT_FALSE(parsed({{"image", image}, {"turntable", "4"}}, kRenderMesh).animation.moves());
    EXPECT_EQ(parsed({{"image", image}, {"animation", "0"}}, kRenderMesh).render.turntable, 0);
    EXPECT_EQ(parsed({{"image", image}, {"turntable", "4"}}, kRenderMesh).render.turntable, 4);
    EXPECT_EQ(refusal_text({{"image", image}, {"turntable", "4"}, {"animation", "0"}}, kRenderMesh),
              "turntable: expected one grid: no animation, or its time, got \"frames of an "
              "animation\"");
    EXPECT_EQ(
        parsed({{"image", image}, {"turntable", "4"}, {"time", "1"}}, kRenderMesh).animation.time_s,
        1.0);
    // Only the job knows the frames of a grid or sequence.
    parsed({{"image", image}}, kRenderGrid);
  }
  EXPECT_EQ(refusal_text({{"frame", "1"}, {"time", "1"}}, kRenderMesh),
            "frame: expected frames of an animation, and not its time, got \"1\"");
  EXPECT_EQ(canonical({{"frame", "1"}}, kRenderMesh),
            canonical({{"frame", "1"}, {"animation", "0"}}, kRenderMesh));
  EXPECT_EQ(canonical({{"fps", "12"}}, kVoxelize),
            canonical({{"fps", "12"}, {"animation", "0"}}, kVoxelize));
  EXPECT_EQ(parsed({{"frame", "1"}, {"animation", "0"}}, kRenderMesh).render.frame, 1);
}

TEST(ImageOptions, a_frame_is_one_of_those_that_are_asked_for) {
  EXPECT_EQ(parsed({{"frame", "2"}, {"frames", "10..12"}}, kRenderGrid).render.frame, 2);
  EXPECT_EQ(refusal_text({{"frame", "3"}, {"frames", "10..12"}}, kRenderGrid),
            "frame: expected less than 3, the number of frames that are asked for, got \"3\"");
  EXPECT_EQ(refusal_text({{"frame", "2"}, {"times", "0,1"}}, kRenderMesh),
            "frame: expected less than 2, the number of frames that are asked for, got \"2\"");
}

}  // namespace
}  // namespace voxeld
