#include "proto/messages/sequence.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "proto/limits.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

const std::string kGridA = "sha256-" + std::string(64, 'a');
const std::string kGridB = "sha256-" + std::string(64, 'b');
const std::string kHash = "sha256-" + std::string(64, '0');

SequenceManifest manifest() {
  SequenceManifest m;
  m.dims = {3, 40, 16384};
  m.origin = {-1.5, 0, 1e-9};
  m.voxel_size = {0.1, 0.1, 0.30000000000000004};
  m.channels.color = m.channels.distance = true;
  m.fps = 24;
  m.frames = {{0, kGridA, 7, kHash},
              {1.0 / 24, kGridB, 12'345'678'901, kHash},
              {2.0 / 24, kGridA, 7, kHash}};
  m.meta_json = R"({"z":1,"animation":{"name":"walk","b":[1,2]},"a":"é"})";
  return m;
}
std::string sequence_refusal(const Json& json) {
  const auto back = parse_sequence(json.dump());
  EXPECT_FALSE(back) << json.dump().substr(0, 200);
  if (back) return "";
  EXPECT_EQ(back.error().code, ErrorCode::kBadRequest);
  return back.error().message();
}
Json with(const std::string& pointer, const Json& value) {
  Json json = Json::parse(sequence_json(manifest()));
  json[Json::json_pointer(pointer)] = value;
  return json;
}
Json without(const std::string& parent, const std::string& name) {
  Json json = Json::parse(sequence_json(manifest()));
  json[Json::json_pointer(parent)].erase(name);
  return json;
}

TEST(SequenceManifest, is_one_text) {
  SequenceManifest small = manifest();
  small.frames.resize(1);
  EXPECT_EQ(sequence_json(small),
            R"({"dims":[3,40,16384],"origin":[-1.5,0.0,1e-09],)"
            R"("voxel_size":[0.1,0.1,0.30000000000000004],"channels":["color","distance"],)"
            R"("fps":24.0,"frames":[{"time_s":0.0,"grid":")" +
                kGridA + R"(","voxel_count":7,"content_hash":")" + kHash +
                R"("}],"meta":{"z":1,"animation":{"name":"walk","b":[1,2]},"a":"é"}})");
}

TEST(SequenceManifest, comes_back_and_gives_the_same_bytes) {
  const std::string text = sequence_json(manifest());
  const auto back = parse_sequence(text);
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_EQ(sequence_json(*back), text);
  EXPECT_EQ(back->dims, manifest().dims);
  EXPECT_EQ(back->origin, manifest().origin);
  EXPECT_EQ(back->voxel_size, manifest().voxel_size);
  EXPECT_EQ(back->channels, manifest().channels);
  EXPECT_EQ(back->fps, 24);
  ASSERT_EQ(back->frames.size(), 3u);
  EXPECT_EQ(back->frames[1].time_s, 1.0 / 24);
  EXPECT_EQ(back->frames[1].grid, kGridB);
  EXPECT_EQ(back->frames[1].voxel_count, 12'345'678'901u);
  EXPECT_EQ(back->frames[1].content_hash, kHash);
  EXPECT_EQ(back->meta_json, manifest().meta_json);
}

TEST(SequenceManifest, the_longest_one_is_read) {
  SequenceManifest longest = manifest();
  longest.frames.clear();
  for (int i = 0; i < limits::kFramesMax; ++i) {
    longest.frames.push_back({i / 23.976, kGridA, ~uint64_t{0} >> 1, kHash});
  }
  const std::string text = sequence_json(longest);
  EXPECT_GT(text.size(), size_t{limits::kJsonBodyBytesMax} / 2);
  const auto back = parse_sequence(text);
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_EQ(sequence_json(*back), text);
  longest.frames.push_back({1e6, kGridA, 1, kHash});
  EXPECT_EQ(parse_sequence(sequence_json(longest)).error().message(),
            "sequence.frames: expected 1 to 4096 frames, got 4097");
}

TEST(SequenceManifest, every_member_must_be_there_and_no_other) {
  for (const char* name : {"dims", "origin", "voxel_size", "channels", "fps", "frames", "meta"}) {
    EXPECT_EQ(sequence_refusal(without("", name)),
              "sequence." + std::string(name) + ": expected a value, got nothing");
  }
  for (const char* name : {"time_s", "grid", "voxel_count", "content_hash"}) {
    EXPECT_EQ(sequence_refusal(without("/frames/1", name)),
              "sequence.frames[1]." + std::string(name) + ": expected a value, got nothing");
  }
  EXPECT_EQ(
      sequence_refusal(with("/size", 5)),
      "sequence: no such member: expected dims, origin, voxel_size, channels, fps, frames, meta, "
      "got \"size\"");
  EXPECT_EQ(
      sequence_refusal(with("/frames/2/name", 5)),
      "sequence.frames[2]: no such member: expected time_s, grid, voxel_count, content_hash, got "
      "\"name\"");
}

TEST(SequenceManifest, values_are_checked) {
  const std::string sides = "sequence.dims: expected three integers from 1 to 16384, got ";
  EXPECT_EQ(sequence_refusal(with("/dims/1", 0)), sides + "[3,0,16384]");
  EXPECT_EQ(sequence_refusal(with("/dims/1", 16385)), sides + "[3,16385,16384]");
  EXPECT_EQ(sequence_refusal(with("/dims/1", 1.5)), sides + "[3,1.5,16384]");
  EXPECT_EQ(sequence_refusal(with("/dims", 5)), sides + "number");
  EXPECT_EQ(sequence_refusal(with("/origin", {1, 2})),
            "sequence.origin: expected three numbers, got [1,2]");
  EXPECT_EQ(sequence_refusal(with("/voxel_size/0", 0)).substr(0, 54),
            "sequence.voxel_size: expected three positive numbers, ");
  const std::string channels =
      "sequence.channels: expected a list of color, normal, material, label, distance and "
      "coverage, in this order, got ";
  EXPECT_EQ(sequence_refusal(with("/channels", {"smell"})), channels + R"(["smell"])");
  EXPECT_EQ(sequence_refusal(with("/channels", {"color", "color"})),
            channels + R"(["color","color"])");
  EXPECT_EQ(sequence_refusal(with("/channels", {"normal", "color"})),
            channels + R"(["normal","color"])");
  EXPECT_EQ(sequence_refusal(with("/channels", {5})), channels + "[5]");
  EXPECT_EQ(sequence_refusal(with("/fps", -1)),
            "sequence.fps: expected frames per second, or 0, got -1");
  EXPECT_EQ(sequence_refusal(with("/fps", "24")),
            "sequence.fps: expected frames per second, or 0, got string");
  EXPECT_EQ(sequence_refusal(with("/frames", Json::array())),
            "sequence.frames: expected 1 to 4096 frames, got 0");
  EXPECT_EQ(sequence_refusal(with("/frames/1/time_s", 0)),
            "sequence.frames[1].time_s: expected more than that of the frame before, got 0");
  EXPECT_EQ(sequence_refusal(with("/frames/0/time_s", -1)),
            "sequence.frames[0].time_s: expected seconds from 0 on, got -1");
  EXPECT_EQ(sequence_refusal(with("/frames/2/grid", "sha256-5")),
            "sequence.frames[2].grid: expected the id of a grid, got sha256-5");
  EXPECT_EQ(sequence_refusal(with("/frames/2/grid", 5)),
            "sequence.frames[2].grid: expected a text, got number");
  EXPECT_EQ(sequence_refusal(with("/frames/2/voxel_count", -5)),
            "sequence.frames[2].voxel_count: expected 0 or more, got -5");
  EXPECT_EQ(sequence_refusal(with("/frames/2/content_hash", "5")),
            "sequence.frames[2].content_hash: expected sha256- and 64 hex digits, got 5");
  EXPECT_EQ(sequence_refusal(with("/meta", Json::array())),
            "sequence.meta: expected an object, got array");
  EXPECT_EQ(sequence_refusal(Json::array()), "sequence: expected an object, got array");
}

TEST(SequenceManifest, every_truncation_is_refused) {
  const std::string text = sequence_json(manifest());
  for (size_t bytes = 0; bytes < text.size(); ++bytes) {
    EXPECT_FALSE(parse_sequence(std::string_view(text).substr(0, bytes))) << bytes;
  }
}

}  // namespace
}  // namespace voxeld
