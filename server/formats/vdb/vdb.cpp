// Writes OpenVDB's .vdb, file version 224: a sparse tree for each kind of values. file_header.h and
// tree_writer.h have the byte maps.
//
//   density   float, "fog volume": 1, or the coverage; not in a band without coverage
//   surface   float, the distance in world units (in voxels if those are no cubes, unless
//             distance=world), negative inside; "level set" in a band or a solid if the unit is
//             that of the world. The background is the largest distance; cells inside that have no
//             voxel are minus that
//   color     vec3s, "invariant": linear light
//   alpha     float, if a voxel is not opaque
//   normal    vec3s, "covariant normalize"
//   material, label   int32: id, 0: none; `names` is a JSON object of names by id
//
// The voxels of the grid are active in each of them. A voxel inside of a solid without attributes
// of its own has the mean colour, alpha 1, normal 0, id 0, coverage 1 and the largest distance
// inside.
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/npy/sample_writers.h"
#include "server/formats/output_file.h"
#include "server/formats/vdb/file_header.h"
#include "server/formats/vdb/grid_values.h"
#include "server/formats/vdb/tree_writer.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::vdb {
namespace {

class DensityValues : public GridValues<float> {
 public:
  explicit DensityValues(const Grid& grid) : has_coverage_(grid.channels.coverage) { inner = 1.0F; }
  void fill(const SparseTile& tile, size_t first, std::span<float> values) const override {
    for (size_t i = 0; i < values.size(); ++i) {
      values[i] = has_coverage_ ? static_cast<float>(tile.coverage[first + i]) / UINT8_MAX : 1.0F;
    }
  }

 private:
  bool has_coverage_;
};

class DistanceValues : public GridValues<float> {
 public:
  explicit DistanceValues(const Grid& grid) : scale_(volume::stored_distance_scale(grid)) {
    background = in_world(farthest(grid, &SparseTile::distance));
    inner = -background;
    is_signed = grid.meta.is_band();
  }
  void fill(const SparseTile& tile, size_t first, std::span<float> values) const override {
    for (size_t i = 0; i < values.size(); ++i) {
      values[i] = in_world(static_cast<float>(tile.distance[first + i]) / kDistanceSteps);
    }
  }

 private:
  float in_world(float voxels) const { return static_cast<float>(voxels * scale_); }

  double scale_;
};

// Whether a voxel has a colour: those inside of solids have zeros instead.
bool has_color(const uint8_t* color) {
  return std::any_of(color, color + 4, [](uint8_t byte) { return byte != 0; });
}

Vec3s linear_color(const uint8_t* color) {
  return {linear_from_srgb(color[0]), linear_from_srgb(color[1]), linear_from_srgb(color[2])};
}

class ColorValues : public GridValues<Vec3s> {
 public:
  explicit ColorValues(const Grid& grid) { inner = linear_color(mean_color(grid).data()); }
  void fill(const SparseTile& tile, size_t first, std::span<Vec3s> values) const override {
    for (size_t i = 0; i < values.size(); ++i) {
      const uint8_t* const color = &tile.color[4 * (first + i)];
      values[i] = has_color(color) ? linear_color(color) : inner;
    }
  }
};

class AlphaValues : public GridValues<float> {
 public:
  AlphaValues() { inner = 1.0F; }
  void fill(const SparseTile& tile, size_t first, std::span<float> values) const override {
    for (size_t i = 0; i < values.size(); ++i) {
      const uint8_t* const color = &tile.color[4 * (first + i)];
      values[i] = has_color(color) ? static_cast<float>(color[3]) / UINT8_MAX : inner;
    }
  }
};

bool has_transparent(const SparseTile& tile) {
  cancel_point();
  for (size_t i = 0; i < tile.color.size(); i += 4) {
    if (tile.color[i + 3] != UINT8_MAX && has_color(&tile.color[i])) return true;
  }
  return false;
}

class NormalValues : public GridValues<Vec3s> {
 public:
  void fill(const SparseTile& tile, size_t first, std::span<Vec3s> values) const override {
    for (size_t i = 0; i < values.size(); ++i) {
      for (size_t c = 0; c < 3; ++c) {
        values[i][c] = static_cast<float>(tile.normal[3 * (first + i) + c]) / INT8_MAX;
      }
    }
  }
};

class IdValues : public GridValues<int32_t> {
 public:
  explicit IdValues(Channel channel) : channel_(channel) {}
  void fill(const SparseTile& tile, size_t first, std::span<int32_t> values) const override {
    const std::vector<uint16_t>& ids = id_samples(tile, channel_);
    for (size_t i = 0; i < values.size(); ++i) values[i] = ids[first + i];
  }

 private:
  Channel channel_;
};

std::string fill_option(const GridMeta& meta) {
  const auto options = meta.members().find("options");
  if (options == meta.members().end() || !options->is_object()) return "";
  const auto fill = options->find("fill");
  return fill != options->end() && fill->is_string() ? fill->get<std::string>() : "";
}

// Only bands and solids tell on which side a cell without a voxel is.
bool is_level_set(const Grid& grid) {
  const std::string fill = fill_option(grid.meta);
  return volume::has_world_distances(grid) && (fill == "band" || fill == "solid");
}

// The names of a channel's ids as a JSON object, or empty.
std::string names_json(const Grid& grid, Channel channel) {
  nlohmann::json members = nlohmann::json::object();
  const std::vector<std::string> names = volume::names_of_ids(grid, channel);
  for (size_t id = 0; id < names.size(); ++id) {
    if (!names[id].empty()) members[std::to_string(id)] = names[id];
  }
  return members.empty() ? "" : members.dump();
}

template <typename Value>
constexpr std::string_view tree_type() {
  if constexpr (std::is_same_v<Value, float>) {
    return "Tree_float_5_4_3";
  } else if constexpr (std::is_same_v<Value, Vec3s>) {
    return "Tree_vec3s_5_4_3";
  } else {
    return "Tree_int32_5_4_3";
  }
}

// Writes the grids of one file.
class VdbFile {
 public:
  VdbFile(const Grid& grid, OutputFile& file) : grid_(grid), order_(grid), file_(file) {
    if (!grid.meta.is_band() || grid.channels.coverage) names_.emplace_back("density");
    if (grid.channels.distance) names_.emplace_back("surface");
    if (grid.channels.color) names_.emplace_back("color");
    if (grid.channels.color && std::ranges::any_of(grid.tiles, has_transparent))
      names_.emplace_back("alpha");
    for (const auto& [channel, name] : {std::pair{Channel::kNormal, "normal"},
                                        {Channel::kMaterial, "material"},
                                        {Channel::kLabel, "label"}}) {
      if (grid.channels.has(channel)) names_.emplace_back(name);
    }
  }

  Status write() {
    VOXELD_TRY(file_.append(file_header(grid_, static_cast<uint32_t>(names_.size()))));
    for (const std::string& name : names_) VOXELD_TRY(write_named(name));
    return {};
  }

 private:
  Status write_named(const std::string& name) {
    if (name == "density") {
      return write_grid(name, DensityValues(grid_), {{"class", text_meta("fog volume")}});
    }
    if (name == "surface") {
      const char* const of = is_level_set(grid_) ? "level set" : "unknown";
      return write_grid(name, DistanceValues(grid_), {{"class", text_meta(of)}});
    }
    if (name == "color") {
      return write_grid(name, ColorValues(grid_), {{"vector_type", text_meta("invariant")}});
    }
    if (name == "alpha") return write_grid(name, AlphaValues(), {});
    if (name == "normal") {
      return write_grid(name, NormalValues(), {{"vector_type", text_meta("covariant normalize")}});
    }
    const Channel channel = name == "label" ? Channel::kLabel : Channel::kMaterial;
    MetaMap meta;
    if (const std::string names = names_json(grid_, channel); !names.empty()) {
      meta["names"] = text_meta(names);
    }
    return write_grid(name, IdValues(channel), std::move(meta));
  }

  template <typename Value>
  Status write_grid(const std::string& name, const GridValues<Value>& values, MetaMap meta) {
    const TreeWriter<Value> tree(order_, values);
    Bytes head;
    put_text(head, name);
    put_text(head, tree_type<Value>());
    put_text(head, "");
    const uint64_t offsets_at = file_.size() + head.size();
    std::array<int64_t, 3> offsets{};
    put(head, offsets);
    offsets[0] = static_cast<int64_t>(file_.size() + head.size());
    put(head, kCompression);
    meta.emplace("class", text_meta("unknown"));
    meta["creator"] = text_meta("voxeld");
    meta["file_bbox_max"] = cell_meta(tree.active().max);
    meta["file_bbox_min"] = cell_meta(tree.active().min);
    meta["file_compression"] = text_meta("zip + active values");
    meta["file_voxel_count"] = count_meta(tree.active().count);
    meta["is_local_space"] = bool_meta(false);
    meta["is_saved_as_half_float"] = bool_meta(false);
    meta["name"] = text_meta(name);
    put_meta(head, meta);
    put_transform(head, grid_.spec);
    VOXELD_TRY(file_.append(head));
    VOXELD_TRY(tree.write_topology(file_));
    offsets[1] = static_cast<int64_t>(file_.size());
    VOXELD_TRY(tree.write_leaves(file_));
    offsets[2] = static_cast<int64_t>(file_.size());
    return file_.replace(offsets_at, bytes_of(offsets));
  }

  const Grid& grid_;
  const TreeOrder order_;
  OutputFile& file_;
  std::vector<std::string> names_;
};

}  // namespace
}  // namespace voxeld::vdb

namespace voxeld {

Status encode_vdb(const Grid& grid, const OutputOptions& /*options*/, OutputFile& file) {
  return vdb::VdbFile(grid, file).write();
}

}  // namespace voxeld
