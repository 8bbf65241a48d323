// Writes OpenVDB's .vdb, file version 224: a sparse tree for each kind of values. named_grids.h
// lists them, file_header.h and tree_writer.h have the byte maps.
//
//   type      float, vec3s or int32
//   class     "fog volume", "level set" or "unknown"
//   color     has vector type "invariant", normal "covariant normalize"
//   material, label   have `names`, a JSON object of names by id
#include <array>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include <nlohmann/json.hpp>

#include "server/formats/formats.h"
#include "server/formats/output_file.h"
#include "server/formats/vdb/file_header.h"
#include "server/formats/vdb/grid_values.h"
#include "server/formats/vdb/named_grids.h"
#include "server/formats/vdb/tree_writer.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::vdb {
namespace {

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

constexpr std::string_view class_text(VolumeClass of) {
  if (of == VolumeClass::kFogVolume) return "fog volume";
  return of == VolumeClass::kLevelSet ? "level set" : "unknown";
}

// Writes the grids of one file.
class VdbFile {
 public:
  VdbFile(const Grid& grid, OutputFile& file)
      : grid_(grid), order_(grid), names_(names_of_grids(grid)), file_(file) {}

  Status write() {
    VOXELD_TRY(file_.append(file_header(grid_, static_cast<uint32_t>(names_.size()))));
    for (const std::string& name : names_) {
      const NamedGrid named = named_grid(grid_, name);
      MetaMap meta = meta_of(name);
      meta["class"] = text_meta(class_text(named.volume_class));
      VOXELD_TRY(
          std::visit([&](const auto& values) { return write_grid(name, *values, std::move(meta)); },
                     named.values));
    }
    return {};
  }

 private:
  MetaMap meta_of(const std::string& name) const {
    if (name == "color") return {{"vector_type", text_meta("invariant")}};
    if (name == "normal") return {{"vector_type", text_meta("covariant normalize")}};
    if (name != "label" && name != "material") return {};
    const std::string names =
        names_json(grid_, name == "label" ? Channel::kLabel : Channel::kMaterial);
    if (names.empty()) return {};
    return {{"names", text_meta(names)}};
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
  const std::vector<std::string> names_;
  OutputFile& file_;
};

}  // namespace
}  // namespace voxeld::vdb

namespace voxeld {

Status encode_vdb(const Grid& grid, const OutputOptions& /*options*/, OutputFile& file) {
  return vdb::VdbFile(grid, file).write();
}

}  // namespace voxeld
