#include "server/formats/minecraft/block_file.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>

#include "proto/options/values.h"
#include "server/formats/lost_data.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::minecraft {
namespace {

// Schematics count cells of a side in 16 bits.
static_assert(limits::kGridSideMax <= 0xffff);

// Metres of a unit; 0 for one that is unknown.
double metres_of(std::string_view units) {
  if (units == "m") return 1;
  if (units == "cm") return 0.01;
  if (units == "mm") return 0.001;
  if (units == "in") return 0.0254;
  return units == "ft" ? 0.3048 : 0;
}

std::string names_without_place(const Grid& grid) {
  const auto ids = coloring_ids(grid);
  std::string names;
  for (const ChannelInfo& info : kChannels) {
    const bool is_kept = info.channel == Channel::kColor || info.channel == ids;
    if (is_kept || !grid.channels.has(info.channel)) continue;
    names += (names.empty() ? "" : ", ") + std::string(info.name);
  }
  return names;
}

// The text of sides that are equal: "0.5"; otherwise "0.5 x 0.25 x 0.5".
std::string sides_text(const glm::dvec3& sides) {
  std::string x = option_values::to_text(sides.x);
  if (sides.x == sides.y && sides.y == sides.z) return x;
  return x + " x " + option_values::to_text(sides.y) + " x " + option_values::to_text(sides.z);
}

std::string dims_text(const glm::ivec3& dims) {
  return std::to_string(dims.x) + " x " + std::to_string(dims.y) + " x " + std::to_string(dims.z);
}

std::optional<Warning> not_metres(const Grid& grid, const std::string& name) {
  constexpr double kRounding = 1e-9;
  const std::string units = volume::units_of(grid);
  const glm::dvec3 off = glm::abs(grid.spec.voxel_size * metres_of(units) - 1.0);
  if (units.empty() || std::max({off.x, off.y, off.z}) < kRounding) return {};
  return Warning{"not-metres", name + ": a block is 1 m, a voxel of this grid " +
                                   sides_text(grid.spec.voxel_size) + " " + units};
}

}  // namespace

void add_placement(NbtWriter& out, const Grid& grid) {
  const GridSpec& spec = grid.spec;
  out.begin("voxeld");
  out.add_double_list("origin",
                      std::array{spec.origin_world.x, spec.origin_world.y, spec.origin_world.z});
  out.add_double_list("voxel_size",
                      std::array{spec.voxel_size.x, spec.voxel_size.y, spec.voxel_size.z});
  if (const std::string units = volume::units_of(grid); !units.empty())
    out.add_text("units", units);
  out.end();
}

Status check_count(Format format, std::string_view what, uint64_t count, uint64_t count_max) {
  if (count <= count_max) return {};
  return Error{ErrorCode::kGridTooLarge,
               std::string(format_name(format)) + ": too many " + std::string(what),
               "at most " + std::to_string(count_max), std::to_string(count)};
}

Status check_cells(const GridSpec& spec, Format format) {
  if (format == Format::kNbt) return {};  // which has no empty cells
  return check_count(format, "cells", static_cast<uint64_t>(spec.cell_count()),
                     static_cast<uint64_t>(kNbtCountMax));
}

std::vector<Warning> block_warnings(const Grid& grid, Format format) {
  std::vector<Warning> warnings;
  const std::string name(format_name(format));
  const glm::ivec3 dims = grid.spec.dims;
  if (const std::string names = names_without_place(grid); !names.empty()) {
    warnings.push_back({"lost-channels", name + ": blocks have no place for " + names});
  }
  if (has_alpha(grid)) {
    warnings.push_back({"lost-alpha", name + ": blocks have no alpha"});
  }
  if (const auto warning = not_metres(grid, name)) warnings.push_back(*warning);
  if (dims.y > kWorldHeight) {
    warnings.push_back({"outside-world", name + ": a world is " + std::to_string(kWorldHeight) +
                                             " blocks high, the grid " + std::to_string(dims.y)});
  }
  const int side = std::max({dims.x, dims.y, dims.z});
  if (format == Format::kNbt && side > kStructureSideMax) {
    warnings.push_back({"large-structure", name + ": a structure block loads at most " +
                                               dims_text(glm::ivec3(kStructureSideMax)) +
                                               " blocks, the grid has " + dims_text(dims)});
  }
  return warnings;
}

}  // namespace voxeld::minecraft
