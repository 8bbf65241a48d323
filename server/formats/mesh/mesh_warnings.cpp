#include "server/formats/mesh/mesh_warnings.h"

#include <string>

#include "server/formats/lost_data.h"

namespace voxeld::mesh {
std::vector<Warning> mesh_warnings(const Grid& grid, const OutputOptions& options) {
  std::vector<Warning> warnings;
  const Format format = options.format;
  const std::string name(format_name(format));
  ChannelSet lost = grid.channels;
  lost.color = false;
  if (const std::string names = joined_names(lost); !names.empty()) {
    warnings.push_back({"lost-channels", name + ": a mesh has no place for " + names});
  }
  if (format == Format::kObj && has_alpha(grid)) {
    warnings.push_back({"lost-alpha", name + ": vertices have no alpha"});
  }
  const bool has_instances = format == Format::kGlb && options.mesh == MeshSurface::kInstances;
  if (has_instances && has_alpha(grid)) {
    warnings.push_back({"lost-alpha", name + ": instances have no alpha"});
  }
  const auto& meta = grid.meta.members();
  const auto units = meta.find("units");
  if (format == Format::kGlb && units != meta.end() && units->is_string()) {
    const auto& unit = units->get_ref<const std::string&>();
    if (!unit.empty() && unit != "m") {
      warnings.push_back(
          {"not-metres", name + ": coordinates are in " + unit + ", not in glTF's metres"});
    }
  }
  return warnings;
}

}  // namespace voxeld::mesh
