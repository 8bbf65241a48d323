// Facts about a grid that the headers of volumes and points state.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "server/grid/grid.h"

namespace voxeld::volume {

// The centre of cell (0,0,0) in world units, which many formats call the origin.
inline glm::dvec3 first_center(const GridSpec& spec) {
  return spec.world_from_grid(glm::dvec3(0.5));
}

// Whether voxels are cubes, but for rounding.
bool is_cubic(const GridSpec& spec);
// Whether files have distances in world units: with distance=world, and where voxels are cubes.
// Otherwise they are in voxels.
bool has_world_distances(const Grid& grid);
// The factors to that unit: from the distances of NumPy arrays, and from distance_unit().
double distance_scale(const Grid& grid);
double stored_distance_scale(const Grid& grid);

// "m", "cm", "mm", "in", "ft", or empty: unknown.
std::string units_of(const Grid& grid);

// The names of a channel's ids, by id; that of 0, no id, is empty. Empty: the grid has no such
// names.
std::vector<std::string> names_of_ids(const Grid& grid, Channel channel);

// Three numbers, each the shortest text that reads back as the same double.
std::string vector_text(const glm::dvec3& vector, std::string_view separator = " ");

inline std::span<const uint8_t> text_bytes(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

}  // namespace voxeld::volume
