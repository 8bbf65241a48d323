#include "server/formats/mesh/world_vertices.h"

#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "proto/options/values.h"

namespace voxeld::mesh {
namespace {

constexpr double kVoxelPart = 256;       // a position's error is at most this part of a voxel
constexpr double kFloatSteps = 1 << 23;  // of a power of two

template <typename Values>
std::string joined(const Values& values) {
  std::string text;
  for (const double value : values) text += ' ' + option_values::to_text(value);
  return text;
}

}  // namespace

bool fits_float(const GridSpec& spec) {
  const glm::dvec3 low = spec.origin_world, high = spec.world_from_grid(glm::dvec3(spec.dims));
  for (int axis = 0; axis < 3; ++axis) {
    const double largest = std::max(std::abs(low[axis]), std::abs(high[axis]));
    if (largest / kFloatSteps > spec.voxel_size[axis] / kVoxelPart) return false;
  }
  return true;
}

std::array<float, 3> world_normal(const GridSpec& spec, const std::array<float, 3>& normal) {
  const glm::dvec3 n =
      glm::normalize(glm::dvec3(normal[0], normal[1], normal[2]) / spec.voxel_size);
  return {static_cast<float>(n.x), static_cast<float>(n.y), static_cast<float>(n.z)};
}

std::vector<std::string> placement_lines(const Grid& grid) {
  const GridHeader header = container_header(grid);
  std::vector<std::string> lines = {"dims" + joined(header.dims), "origin" + joined(header.origin),
                                    "voxel_size" + joined(header.voxel_size)};
  const auto& meta = grid.meta.members();
  if (const auto units = meta.find("units"); units != meta.end() && units->is_string()) {
    if (!units->get<std::string>().empty()) lines.push_back("units " + units->get<std::string>());
  }
  const auto options = meta.find("options");
  if (options == meta.end() || !options->is_object()) return lines;
  const auto transform = options->find("transform");
  if (transform == options->end() || !transform->is_array()) return lines;
  lines.push_back("transform " + transform->dump());
  return lines;
}

}  // namespace voxeld::mesh
