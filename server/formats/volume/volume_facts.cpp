#include "server/formats/volume/volume_facts.h"

#include <cmath>

#include "proto/options/values.h"

namespace voxeld::volume {
namespace {

constexpr double kCubeRounding = 1e-9;  // the difference of a cube's edges, as a part of one

}  // namespace

bool is_cubic(const GridSpec& spec) {
  const glm::dvec3 size = spec.voxel_size;
  const double allowed = kCubeRounding * size.x;
  return std::abs(size.y - size.x) <= allowed && std::abs(size.z - size.x) <= allowed;
}

bool has_world_distances(const Grid& grid) {
  return grid.meta.has_world_distances() || is_cubic(grid.spec);
}

double distance_scale(const Grid& grid) {
  const bool is_scaled = is_cubic(grid.spec) && !grid.meta.has_world_distances();
  return is_scaled ? grid.spec.voxel_size.x : 1.0;
}

double stored_distance_scale(const Grid& grid) {
  return distance_unit(grid) * distance_scale(grid);
}

std::string units_of(const Grid& grid) {
  const auto& meta = grid.meta.members();
  const auto units = meta.find("units");
  return units != meta.end() && units->is_string() ? units->get<std::string>() : "";
}

std::vector<std::string> names_of_ids(const Grid& grid, Channel channel) {
  const auto& meta = grid.meta.members();
  const auto list = meta.find(channel == Channel::kLabel ? "labels" : "materials");
  if (!grid.channels.has(channel) || list == meta.end() || !list->is_array()) return {};
  std::vector<std::string> names;
  for (const auto& entry : *list) {
    if (!entry.is_object()) continue;
    const auto id = entry.find("id"), name = entry.find("name");
    if (id == entry.end() || name == entry.end() || !id->is_number_unsigned()) continue;
    const auto number = id->get<uint64_t>();
    if (number > UINT16_MAX || !name->is_string()) continue;
    if (names.size() <= number) names.resize(number + 1);
    names[number] = name->get<std::string>();
  }
  return names;
}

std::string vector_text(const glm::dvec3& vector, std::string_view separator) {
  return option_values::to_text(vector.x) + std::string(separator) +
         option_values::to_text(vector.y) + std::string(separator) +
         option_values::to_text(vector.z);
}

}  // namespace voxeld::volume
