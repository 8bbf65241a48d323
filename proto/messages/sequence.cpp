// The manifest, in this order and without spaces:
// {"dims": [x, y, z], "origin": […], "voxel_size": […], "channels": ["color", …], "fps": F,
//  "frames": [{"time_s": T, "grid": ID, "voxel_count": N, "content_hash": ID}, …], "meta": {…}}
#include "proto/messages/sequence.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "proto/limits.h"
#include "proto/messages/field_rules.h"
#include "proto/messages/json_bounds.h"
#include "proto/messages/json_fields.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

// 4096 frames take 1.1 MB; the rest is for meta.
constexpr int64_t kManifestBytesMax = int64_t{8} << 20;
// Members of one object. An ordered object searches all of them on each look-up, so the cost is
// quadratic.
constexpr int64_t kMembersMax = 256;

// Three numbers, each of which `is` so. Errors name what is expected of all three.
template <typename Numbers, typename Is>
struct Three {
  Three(Numbers& three, std::string text, Is is_one)
      : numbers(three), expected(std::move(text)), is(is_one) {}
  Numbers& numbers;
  std::string expected;
  Is is;

  Status read(const Json& list) {
    if (!list.is_array()) return unfit(expected, list.type_name());
    if (list.size() != 3 || !std::ranges::all_of(list, is)) return unfit(expected, list.dump());
    numbers = list.get<Numbers>();
    return {};
  }
  template <typename Tree>
  Tree tree() const {
    return numbers;
  }
};

bool is_side(const Json& value) {
  return value.is_number_integer() && value >= 1 && value <= limits::kGridSideMax;
}
bool is_finite(const Json& value) {
  return value.is_number() && std::isfinite(value.get<double>());
}
bool is_positive(const Json& value) {
  return is_finite(value) && value.get<double>() > 0;
}

// Names of channels in the order of the table, each once, so one set of channels has one text.
template <typename Set>
struct ChannelNames {
  explicit ChannelNames(Set& set) : channels(set) {}
  Set& channels;

  Status read(const Json& list) {
    const std::string expected =
        "a list of color, normal, material, label, distance and coverage, in this order";
    if (!list.is_array()) return unfit(expected, list.type_name());
    size_t next = 0;
    for (const Json& name : list) {
      const std::string text = name.is_string() ? name.get<std::string>() : "";
      while (next < kChannelCount && text != kChannels[next].name) ++next;
      if (next == kChannelCount) return unfit(expected, list.dump());
      channels.set(kChannels[next++].channel);
    }
    return {};
  }
  template <typename Tree>
  Tree tree() const {
    Tree names = Tree::array();
    for (const ChannelInfo& info : kChannels) {
      if (channels.has(info.channel)) names.push_back(info.name);
    }
    return names;
  }
};

// The text of an object, and that object in JSON. Json sorts the members, so meta_text() reads the
// text itself.
template <typename Text>
struct MetaText {
  explicit MetaText(Text& member) : text(member) {}
  Text& text;

  Status read(const Json& meta) {
    return meta.is_object() ? Status() : unfit("an object", meta.type_name());
  }
  template <typename Tree>
  Tree tree() const {
    Tree meta = Tree::parse(text, nullptr, false);
    return meta.is_object() ? meta : Tree::object();
  }
};

// Frames per second, or 0.
template <typename Number>
struct Fps {
  explicit Fps(Number& member) : fps(member) {}
  Number& fps;

  Status read(const Json& json) {
    if (!is_finite(json) || json.get<double>() < 0) {
      return unfit("frames per second, or 0", json.is_number() ? json.dump() : json.type_name());
    }
    fps = json.get<double>();
    return {};
  }
  template <typename Tree>
  Tree tree() const {
    return fps;
  }
};

Status are_frames(const std::vector<SequenceFrame>& frames) {
  VOXELD_TRY(count_from_1(size_t{limits::kFramesMax}, "frames")(frames));
  for (size_t i = 1; i < frames.size(); ++i) {
    if (frames[i].time_s > frames[i - 1].time_s) continue;
    return within_member(
        list_index(i) + ".time_s",
        unfit("more than that of the frame before", option_values::to_text(frames[i].time_s)));
  }
  return {};
}

}  // namespace

void visit_fields(IsA<SequenceFrame> auto& frame, auto& visit) {
  visit(kRequired, "time_s", frame.time_s, seconds_from_0());
  visit(kRequired, "grid", frame.grid, blob_id("the id of a grid"));
  visit(kRequired, "voxel_count", frame.voxel_count);
  visit(kRequired, "content_hash", frame.content_hash, blob_id("sha256- and 64 hex digits"));
}

void visit_fields(IsA<SequenceManifest> auto& manifest, auto& visit) {
  visit.name("sequence");
  visit(kRequired, "dims",
        Three(manifest.dims, "three integers from 1 to " + std::to_string(limits::kGridSideMax),
              is_side));
  visit(kRequired, "origin", Three(manifest.origin, "three numbers", is_finite));
  visit(kRequired, "voxel_size", Three(manifest.voxel_size, "three positive numbers", is_positive));
  visit(kRequired, "channels", ChannelNames(manifest.channels));
  visit(kRequired, "fps", Fps(manifest.fps));
  visit(kRequired, "frames", manifest.frames, are_frames);
  visit(kRequired, "meta", MetaText(manifest.meta_json));
}

namespace {

// The member in the order of its text.
std::string meta_text(std::string_view json) {
  const Ordered body = Ordered::parse(json.begin(), json.end(), nullptr, false);
  return body["meta"].dump();
}

}  // namespace

std::string sequence_json(const SequenceManifest& manifest) {
  return fields_json<Ordered>(manifest).dump(-1, ' ', false, Ordered::error_handler_t::replace);
}

Result<SequenceManifest> parse_sequence(std::string_view json) {
  VOXELD_ASSIGN(const Json body, parse_json_bounded(json, JsonBounds{.bytes_max = kManifestBytesMax,
                                                                     .members_max = kMembersMax}));
  SequenceManifest manifest;
  VOXELD_TRY(read_fields(body, manifest, Unlisted::kRefuse));
  manifest.meta_json = meta_text(json);
  return manifest;
}

}  // namespace voxeld
