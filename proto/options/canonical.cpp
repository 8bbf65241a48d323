// Canonical JSON of options: the text from which result names are made. Every default is spelled
// out, so a changed default in a later version cannot give an old result to a new request.
#include <nlohmann/json.hpp>

#include "proto/hex.h"
#include "proto/options/options.h"
#include "proto/options/values.h"
#include "proto/options/words.h"

namespace voxeld {
namespace {

using namespace option_values;
namespace words = option_words;
using Json = nlohmann::ordered_json;

template <typename Enum, size_t N>
std::string word(Enum value, const std::array<Word<Enum>, N>& list) {
  return std::string(word_of<Enum>(value, list));
}

template <size_t N>
void add_numbers(Json& out, const char* name, const std::optional<std::array<double, N>>& values) {
  if (values) out[name] = to_text(*values);
}

void add_placement(Json& out, const PlacementOptions& p) {
  if (p.dims) {
    out["dims"] = std::to_string((*p.dims)[0]) + "," + std::to_string((*p.dims)[1]) + "," +
                  std::to_string((*p.dims)[2]);
  } else if (p.voxel_size) {
    add_numbers(out, "voxel_size", p.voxel_size);
  } else {
    out["size"] = p.size.value_or(kDefaultSize);
  }
  out["padding"] = p.padding;
  add_numbers(out, "bounds", p.bounds);
  out["up"] = word(p.up, words::kUp);
  if (!p.units.empty()) out["units"] = p.units;
  add_numbers(out, "transform", p.transform);
}

void add_voxelize(Json& out, const VoxelizeOptions& v) {
  add_placement(out, v.placement);
  out["rule"] = word(v.rule, words::kRule);
  out["fill"] = word(v.fill, words::kFill);
  const bool has_inside = v.fill == Fill::kSolid || v.fill == Fill::kShell;
  const bool measures = v.channel_distance || (v.fill == Fill::kBand && !v.channels_given);
  if (has_inside || measures) out["sign"] = word(v.sign, words::kSign);
  if (v.fill == Fill::kShell || v.fill == Fill::kBand) out["thickness"] = to_text(v.thickness);
  if (has_inside) out["interior"] = word(v.interior, words::kInterior);
  out["color"] = word(v.color, words::kColor);
  if (v.channels_given) {
    std::string channels = "occupancy";
    if (v.channel_color) channels += ",color";
    if (v.channel_normal) channels += ",normal";
    if (v.channel_material) channels += ",material";
    if (v.channel_label) channels += ",label";
    if (v.channel_distance) channels += ",distance";
    if (v.channel_coverage) channels += ",coverage";
    out["channels"] = channels;
  }
  if (v.channel_label) out["labels"] = word(v.labels, words::kLabels);
  out["pipeline"] = word(v.pipeline, words::kPipeline);
}

void add_output(Json& out, const OutputOptions& o) {
  out["format"] = std::string(format_name(o.format));
  out["codec"] = word(o.codec, words::kCodec);
  out["axes"] = word(o.axes, words::kAxes);
  out["dtype"] = word(o.dtype, words::kDType);
  out["palette"] = o.palette_max;
}

// Omits members for the whole grid at level 0: earlier versions wrote none, and names must not
// change.
void add_selection(Json& out, const OutputOptions& o) {
  if (o.level > 0) {
    out["level"] = o.level;
    out["level_rule"] = word(o.level_rule, words::kLevelRule);
  }
  if (!o.region) return;
  std::string corners;
  for (const int cell : *o.region) corners += (corners.empty() ? "" : ",") + std::to_string(cell);
  out["region"] = corners;
}

std::string hex_color(const std::array<uint8_t, 4>& color) {
  return "#" + hex_text(color);
}

void add_render(Json& out, const RenderOptions& r) {
  out["width"] = r.width;
  out["height"] = r.height;
  out["projection"] = word(r.projection, words::kProjection);
  out["azimuth"] = to_text(r.azimuth_deg);
  out["elevation"] = to_text(r.elevation_deg);
  out["zoom"] = to_text(r.zoom);
  add_numbers(out, "matrix", r.matrix);
  out["background"] = hex_color(r.background);
  out["light"] = word(r.light, words::kLight);
  out["occlusion"] = word(r.occlusion, words::kYesNo);
  out["shadow"] = word(r.shadow, words::kYesNo);
  out["samples"] = r.samples == 0 ? "auto" : std::to_string(r.samples);
  out["renderer"] = word(r.renderer, words::kRenderer);
  add_numbers(out, "section", r.section);
}

// Omits members for a single image of one grid: earlier versions wrote none, and names must not
// change.
void add_picture(Json& out, const RenderOptions& r) {
  if (r.picture != PictureKind::kPng) out["picture"] = word(r.picture, words::kPicture);
  if (r.frame > 0) out["frame"] = r.frame;
  if (r.turntable > 0) out["turntable"] = r.turntable;
  if (r.rate) out["rate"] = to_text(*r.rate);
  if (r.columns > 0) out["columns"] = r.columns;
}

void add_frames(Json& out, const AnimationOptions& a) {
  if (!a.frames) return;
  out["frames"] = std::to_string((*a.frames)[0]) + ".." + std::to_string((*a.frames)[1]);
}

// Omits all members for a mesh at rest.
void add_animation(Json& out, const AnimationOptions& a) {
  if (!a.moves()) return;
  if (a.animation) out["animation"] = *a.animation;
  if (a.time_s) out["time"] = to_text(*a.time_s);
  add_frames(out, a);
  if (a.fps) out["fps"] = to_text(*a.fps);
  if (!a.times_s.empty()) out["times"] = to_text(a.times_s);
  out["root_motion"] = word(a.root_motion, words::kRootMotion);
}

}  // namespace

std::string canonical_json(const RequestOptions& options, OptionScope scope) {
  Json out = Json::object();
  if (scope == OptionScope::kVoxelize || scope == OptionScope::kRenderMesh) {
    add_voxelize(out, options.voxelize);
    add_animation(out, options.animation);
  } else {
    add_frames(out, options.animation);
  }
  if (scope == OptionScope::kVoxelize || scope == OptionScope::kExport) {
    add_output(out, options.output);
  }
  if (scope == OptionScope::kRenderMesh || scope == OptionScope::kRenderGrid) {
    add_render(out, options.render);
    add_picture(out, options.render);
  }
  add_selection(out, options.output);
  return out.dump();
}

}  // namespace voxeld
