// The grids of a file of OpenVDB or NanoVDB that one Grid becomes.
//
//   density   float, fog volume: 1, or the coverage; not in a band without coverage
//   surface   float, the distance in world units (in voxels if those are no cubes, unless
//             distance=world), negative inside; a level set in a band or a solid if the unit is
//             that of the world. The background is the largest distance; cells inside that have no
//             voxel are minus that
//   color     three floats: linear light
//   alpha     float, if a voxel is not opaque
//   normal    three floats: unit normal
//   material, label   int32: id, 0: none
//
// The voxels of the grid are active in each of them. A voxel inside of a solid without attributes
// of its own has the mean colour, alpha 1, normal 0, id 0, coverage 1 and the largest distance
// inside. Index (i, j, k) is the centre of cell (i, j, k) of the grid.
#pragma once

#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "server/formats/vdb/grid_values.h"
#include "server/grid/grid.h"

namespace voxeld::vdb {

enum class VolumeClass { kUnknown, kLevelSet, kFogVolume };

struct NamedGrid {
  VolumeClass volume_class = VolumeClass::kUnknown;
  std::variant<std::unique_ptr<GridValues<float>>, std::unique_ptr<GridValues<Vec3s>>,
               std::unique_ptr<GridValues<int32_t>>>
      values;
};

// In the order of the file.
std::vector<std::string> names_of_grids(const Grid& grid);
// name: one of those. The grid outlives the values.
NamedGrid named_grid(const Grid& grid, const std::string& name);

// The sides of a voxel in world units: equal ones if voxels are cubes but for rounding.
glm::dvec3 voxel_sides(const GridSpec& spec);

}  // namespace voxeld::vdb
