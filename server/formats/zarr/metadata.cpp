#include "server/formats/zarr/metadata.h"

#include <algorithm>
#include <utility>

#include <nlohmann/json.hpp>

#include "server/formats/volume/volume_array.h"
#include "server/formats/volume/volume_facts.h"
#include "server/grid/level.h"

namespace voxeld::zarr {
namespace {

using nlohmann::json;
using volume::SampleType;

std::string group_path(std::optional<Channel> channel) {
  if (!channel) return "";
  const ChannelInfo& info = channel_info(*channel);
  return (info.is_id() ? "labels/" : "") + std::string(info.name);
}

std::string joined(const std::string& group, const std::string& name) {
  return group.empty() ? name : group + "/" + name;
}

struct SampleNames {
  const char *v3, *v2;
};
SampleNames sample_names(SampleType type) {
  switch (type) {
    case SampleType::kUint8:
      return {"uint8", "|u1"};
    case SampleType::kInt8:
      return {"int8", "|i1"};
    case SampleType::kUint16:
      return {"uint16", "<u2"};
    case SampleType::kFloat32:
      return {"float32", "<f4"};
  }
  return {};
}

// The name of a unit in UDUNITS-2, which OME-Zarr takes; empty: unknown.
std::string unit_name(const std::string& unit) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 5> kNames = {
      {{"m", "meter"}, {"cm", "centimeter"}, {"mm", "millimeter"}, {"in", "inch"}, {"ft", "foot"}}};
  for (const auto& [name, long_name] : kNames) {
    if (unit == name) return std::string(long_name);
  }
  return "";
}

class Documents {
 public:
  Documents(const Grid& common, const FrameAxis& frames, const OutputOptions& options)
      : common_(common), frames_(frames), options_(options) {}

  std::vector<Document> all() && {
    add_root();
    add_arrays(std::nullopt);
    json labels = json::array();
    for (const ChannelInfo& info : kChannels) {
      if (common_.channels.has(info.channel) && info.is_id()) labels.push_back(info.name);
    }
    if (!labels.empty()) add_group("labels", ome({{"labels", labels}}));
    for (const ChannelInfo& info : kChannels) {
      if (!common_.channels.has(info.channel)) continue;
      add_group(group_path(info.channel), channel_attributes(info));
      add_arrays(info.channel);
    }
    if (is_v2()) add(".zmetadata", {{"zarr_consolidated_format", 1}, {"metadata", consolidated_}});
    return std::move(documents_);
  }

 private:
  bool is_v2() const { return options_.zarr_version == 2; }
  bool has_time() const { return frames_.count > 0; }

  void add(const std::string& path, const json& document) {
    documents_.push_back({path, document.dump()});
  }
  void add_v2(const std::string& path, json document) {
    add(path, document);
    consolidated_[path] = std::move(document);
  }

  // Attributes of OME-Zarr at the place where the version has them.
  json ome(json members) const {
    if (is_v2()) return members;
    members["version"] = "0.5";
    return {{"ome", std::move(members)}};
  }

  void add_group(const std::string& path, const json& attributes) {
    if (is_v2()) {
      add_v2(joined(path, ".zgroup"), {{"zarr_format", 2}});
      add_v2(joined(path, ".zattrs"), attributes);
    } else {
      add(joined(path, "zarr.json"),
          {{"zarr_format", 3}, {"node_type", "group"}, {"attributes", attributes}});
    }
  }

  void add_root() {
    json attributes = ome({{"multiscales", {multiscale(std::nullopt)}}});
    json own = {{"meta", json::parse(common_.meta.text())}};
    for (const ChannelInfo& info : kChannels) {
      if (common_.channels.has(info.channel)) own["channels"].push_back(info.name);
    }
    attributes["voxeld"] = std::move(own);
    add_group("", attributes);
  }

  json channel_attributes(const ChannelInfo& info) const {
    if (volume::array_type(info.channel, options_).components > 1) return json::object();
    json members = {{"multiscales", {multiscale(info.channel)}}};
    if (info.is_id()) {
      json image = {{"source", {{"image", "../../"}}}};
      if (is_v2()) image["version"] = "0.4";
      members["image-label"] = std::move(image);
    }
    return ome(std::move(members));
  }

  json axes() const {
    json axes = json::array();
    if (has_time()) {
      json axis = {{"name", "t"}, {"type", "time"}};
      if (frames_.step_s > 0) axis["unit"] = "second";
      axes.push_back(std::move(axis));
    }
    const std::string unit = unit_name(volume::units_of(common_));
    for (const char* name : {"z", "y", "x"}) {
      json axis = {{"name", name}, {"type", "space"}};
      if (!unit.empty()) axis["unit"] = unit;
      axes.push_back(std::move(axis));
    }
    return axes;
  }

  json multiscale(std::optional<Channel> channel) const {
    json datasets = json::array();
    for (int level = 0; level < level_count(common_.spec); ++level) {
      const GridSpec spec = level_spec(common_.spec, level);
      const glm::dvec3 size = spec.voxel_size, center = volume::first_center(spec);
      json scale = json::array(), translation = json::array();
      if (has_time()) {
        scale.push_back(frames_.step_s > 0 ? frames_.step_s : 1.0);
        translation.push_back(frames_.begin_s);
      }
      for (const int axis : {2, 1, 0}) {
        scale.push_back(size[axis]);
        translation.push_back(center[axis]);
      }
      datasets.push_back({{"path", std::to_string(level)},
                          {"coordinateTransformations",
                           {{{"type", "scale"}, {"scale", std::move(scale)}},
                            {{"type", "translation"}, {"translation", std::move(translation)}}}}});
    }
    json image = {
        {"name", volume::array_name(channel)}, {"axes", axes()}, {"datasets", std::move(datasets)}};
    if (is_v2()) image["version"] = "0.4";
    return image;
  }

  void add_arrays(std::optional<Channel> channel) {
    for (int level = 0; level < level_count(common_.spec); ++level) add_array(channel, level);
  }

  void add_array(std::optional<Channel> channel, int level) {
    const volume::ArrayType type = volume::array_type(channel, options_);
    const glm::ivec3 dims = level_spec(common_.spec, level).dims;
    json shape = {dims.z, dims.y, dims.x}, names = {"z", "y", "x"};
    json chunks = {kChunkSide, kChunkSide, kChunkSide};
    if (has_time()) {
      shape.insert(shape.begin(), frames_.count);
      chunks.insert(chunks.begin(), 1);
      names.insert(names.begin(), "t");
    }
    if (type.components > 1) {
      shape.push_back(type.components);
      chunks.push_back(type.components);
      names.push_back("c");
    }
    const bool is_distance = channel && channel_info(*channel).kind == ChannelKind::kDistance;
    const json fill = is_distance                           ? json("NaN")
                      : type.sample == SampleType::kFloat32 ? json(0.0)
                                                            : json(0);
    const SampleNames sample = sample_names(type.sample);
    const std::string path = array_path(channel, level);
    if (is_v2()) {
      add_v2(path + "/.zarray", {{"zarr_format", 2},
                                 {"shape", shape},
                                 {"chunks", chunks},
                                 {"dtype", sample.v2},
                                 {"compressor", {{"id", "gzip"}, {"level", kGzipLevel}}},
                                 {"fill_value", fill},
                                 {"order", "C"},
                                 {"filters", nullptr},
                                 {"dimension_separator", "/"}});
      add_v2(path + "/.zattrs", {{"_ARRAY_DIMENSIONS", names}});
      return;
    }
    json bytes = {{"name", "bytes"}};
    if (type.sample_bytes > 1) bytes["configuration"] = {{"endian", "little"}};
    const json gzip = {{"name", "gzip"}, {"configuration", {{"level", kGzipLevel}}}};
    add(path + "/zarr.json",
        {{"zarr_format", 3},
         {"node_type", "array"},
         {"shape", shape},
         {"data_type", sample.v3},
         {"chunk_grid", {{"name", "regular"}, {"configuration", {{"chunk_shape", chunks}}}}},
         {"chunk_key_encoding", {{"name", "default"}, {"configuration", {{"separator", "/"}}}}},
         {"fill_value", fill},
         {"codecs", json::array({bytes, gzip})},
         {"dimension_names", names},
         {"attributes", json::object()}});
  }

  static constexpr int kGzipLevel = 6;  // readers do not need it; both versions require one

  const Grid& common_;
  const FrameAxis& frames_;
  const OutputOptions& options_;
  std::vector<Document> documents_;
  json consolidated_ = json::object();
};

}  // namespace

int level_count(const GridSpec& spec) {
  int count = 1;
  for (int side = std::max({spec.dims.x, spec.dims.y, spec.dims.z}); side > kChunkSide;
       side = (side + 1) / 2) {
    ++count;
  }
  return count;
}

std::string array_path(std::optional<Channel> channel, int level) {
  return joined(group_path(channel), std::to_string(level));
}

std::string chunk_key(const std::array<uint32_t, 3>& chunk, std::optional<size_t> frame,
                      bool has_components, int version) {
  std::string key = version == 2 ? "" : "c/";
  if (frame) key += std::to_string(*frame) + "/";
  key += std::to_string(chunk[2]) + "/" + std::to_string(chunk[1]) + "/" + std::to_string(chunk[0]);
  return has_components ? key + "/0" : key;
}

std::vector<Document> documents(const Grid& common, const FrameAxis& frames,
                                const OutputOptions& options) {
  return Documents(common, frames, options).all();
}

}  // namespace voxeld::zarr
