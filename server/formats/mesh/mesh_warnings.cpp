#include "server/formats/mesh/mesh_warnings.h"

#include <string>

#include "server/formats/lost_data.h"
#include "server/grid/morphology/cut_tiles.h"

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
  if (!colors_have_alpha(options) && has_alpha(grid)) {
    const std::string colored = format == Format::kObj ? "vertices" : "instances";
    warnings.push_back({"lost-alpha", name + ": " + colored + " have no alpha"});
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
