// The manifest, in this order and without spaces:
// {"dims": [x, y, z], "origin": […], "voxel_size": […], "channels": ["color", …], "fps": F,
//  "frames": [{"time_s": T, "grid": ID, "voxel_count": N, "content_hash": ID}, …], "meta": {…}}
#include "proto/messages/sequence.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "proto/blob_id.h"
#include "proto/limits.h"
#include "proto/messages/job.h"
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

Error bad(std::string where, std::string_view expected, std::string_view got) {
  return {ErrorCode::kBadRequest, "sequence" + std::move(where), std::string(expected),
          std::string(got.substr(0, 80))};
}

Status check_members(const Json& object, const std::string& where,
                     std::initializer_list<std::string_view> names) {
  if (!object.is_object()) return bad(where, "an object", object.type_name());
  for (const std::string_view name : names) {
    if (!object.contains(name)) {
      return bad(where + "." + std::string(name), "it to be there", "nothing");
    }
  }
  for (const auto& [name, value] : object.items()) {
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      return bad(where, "no other members", "\"" + name.substr(0, 40) + "\"");
    }
  }
  return {};
}

template <typename Is>
Status check_three(const Json& list, const char* name, std::string_view expected, Is is) {
  const std::string where = "." + std::string(name);
  if (!list.is_array()) return bad(where, expected, list.type_name());
  if (list.size() != 3 || !std::all_of(list.begin(), list.end(), is)) {
    return bad(where, expected, list.dump());
  }
  return {};
}

Status read_place(const Json& body, SequenceManifest& manifest) {
  const auto is_side = [](const Json& v) {
    return v.is_number_integer() && v >= 1 && v <= limits::kGridSideMax;
  };
  const auto is_finite = [](const Json& v) {
    return v.is_number() && std::isfinite(v.get<double>());
  };
  const auto is_positive = [&](const Json& v) { return is_finite(v) && v.get<double>() > 0; };
  VOXELD_TRY(check_three(body["dims"], "dims",
                         "three integers from 1 to " + std::to_string(limits::kGridSideMax),
                         is_side));
  VOXELD_TRY(check_three(body["origin"], "origin", "three numbers", is_finite));
  VOXELD_TRY(check_three(body["voxel_size"], "voxel_size", "three positive numbers", is_positive));
  manifest.dims = body["dims"].get<std::array<int32_t, 3>>();
  manifest.origin = body["origin"].get<std::array<double, 3>>();
  manifest.voxel_size = body["voxel_size"].get<std::array<double, 3>>();
  return {};
}

// Channels must be in the order of the table, each once, so one set of channels has one text.
Status read_channels(const Json& list, ChannelSet& channels) {
  const std::string_view expected =
      "a list of color, normal, material, label, distance and coverage, in this order";
  if (!list.is_array()) return bad(".channels", expected, list.type_name());
  size_t next = 0;
  for (const Json& name : list) {
    const std::string text = name.is_string() ? name.get<std::string>() : "";
    while (next < kChannelCount && text != kChannels[next].name) ++next;
    if (next == kChannelCount) return bad(".channels", expected, list.dump());
    channels.set(kChannels[next++].channel);
  }
  return {};
}

Result<SequenceFrame> read_frame(const Json& entry, const std::string& where) {
  VOXELD_TRY(check_members(entry, where, {"time_s", "grid", "voxel_count", "content_hash"}));
  SequenceFrame frame;
  int64_t voxel_count = 0;
  const std::string what = "sequence" + where;
  JsonFields fields(entry, what);
  fields.read("time_s", frame.time_s);
  fields.read("grid", frame.grid);
  fields.read("voxel_count", voxel_count);
  fields.read("content_hash", frame.content_hash);
  VOXELD_TRY(fields.finish());
  if (!std::isfinite(frame.time_s) || frame.time_s < 0) {
    return bad(where + ".time_s", "seconds from 0 on", entry["time_s"].dump());
  }
  if (!is_blob_id(frame.grid)) return bad(where + ".grid", "the id of a grid", frame.grid);
  if (voxel_count < 0) {
    return bad(where + ".voxel_count", "0 or more", std::to_string(voxel_count));
  }
  if (!is_blob_id(frame.content_hash)) {
    return bad(where + ".content_hash", "sha256- and 64 hex digits", frame.content_hash);
  }
  frame.voxel_count = static_cast<uint64_t>(voxel_count);
  return frame;
}

Status read_frames(const Json& list, std::vector<SequenceFrame>& frames) {
  if (!list.is_array()) return bad(".frames", "a list", list.type_name());
  constexpr auto kMax = static_cast<size_t>(limits::kFramesMax);
  if (list.empty() || list.size() > kMax) {
    return bad(".frames", "1 to " + std::to_string(kMax) + " frames", std::to_string(list.size()));
  }
  frames.reserve(list.size());
  for (const Json& entry : list) {
    const std::string where = ".frames[" + std::to_string(frames.size()) + "]";
    VOXELD_ASSIGN(SequenceFrame frame, read_frame(entry, where));
    if (!frames.empty() && !(frame.time_s > frames.back().time_s)) {
      return bad(where + ".time_s", "more than that of the frame before", entry["time_s"].dump());
    }
    frames.push_back(std::move(frame));
  }
  return {};
}

// The member as it is in the text. Json sorts the members of objects; Ordered keeps their order.
Result<std::string> meta_text(std::string_view json) {
  const Ordered body = Ordered::parse(json.begin(), json.end(), nullptr, false);
  const Ordered& meta = body["meta"];
  if (!meta.is_object()) return bad(".meta", "an object", meta.type_name());
  return meta.dump();
}

Ordered meta_object(const std::string& text) {
  Ordered meta = Ordered::parse(text, nullptr, false);
  return meta.is_object() ? meta : Ordered::object();
}

}  // namespace

std::string sequence_json(const SequenceManifest& manifest) {
  Ordered channels = Ordered::array(), frames = Ordered::array();
  for (const ChannelInfo& info : kChannels) {
    if (manifest.channels.has(info.channel)) channels.push_back(info.name);
  }
  for (const SequenceFrame& frame : manifest.frames) {
    frames.push_back({{"time_s", frame.time_s},
                      {"grid", frame.grid},
                      {"voxel_count", frame.voxel_count},
                      {"content_hash", frame.content_hash}});
  }
  Ordered body = Ordered::object();
  body["dims"] = manifest.dims;
  body["origin"] = manifest.origin;
  body["voxel_size"] = manifest.voxel_size;
  body["channels"] = std::move(channels);
  body["fps"] = manifest.fps;
  body["frames"] = std::move(frames);
  body["meta"] = meta_object(manifest.meta_json);
  return body.dump(-1, ' ', false, Ordered::error_handler_t::replace);
}

Result<SequenceManifest> parse_sequence(std::string_view json) {
  VOXELD_ASSIGN(const Json body, parse_json_bounded(json, JsonBounds{.bytes_max = kManifestBytesMax,
                                                                     .members_max = kMembersMax}));
  VOXELD_TRY(check_members(body, "",
                           {"dims", "origin", "voxel_size", "channels", "fps", "frames", "meta"}));
  SequenceManifest manifest;
  VOXELD_TRY(read_place(body, manifest));
  VOXELD_TRY(read_channels(body["channels"], manifest.channels));
  const Json& fps = body["fps"];
  if (!fps.is_number() || !std::isfinite(fps.get<double>()) || fps.get<double>() < 0) {
    return bad(".fps", "frames per second, or 0", fps.is_number() ? fps.dump() : fps.type_name());
  }
  manifest.fps = fps.get<double>();
  VOXELD_TRY(read_frames(body["frames"], manifest.frames));
  VOXELD_ASSIGN(manifest.meta_json, meta_text(json));
  return manifest;
}

}  // namespace voxeld
