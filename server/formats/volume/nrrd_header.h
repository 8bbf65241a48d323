// The text header of NRRD, the "nearly raw raster data" of teem, version 4: lines of a field each.
//
//   space             3D-right-handed, which says nothing about a patient
//   space directions  the voxel size along each axis; "none" for components
//   space origin      the centre of the first cell
//   space units       the grid's units, if it has them
//   kinds             RGBA-color, 3-normal or none for components; domain for axes
//   key:=value        units, and meta as JSON with the names of ids
//
// The specification: http://teem.sourceforge.net/nrrd/format.html
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "server/formats/volume/volume_array.h"
#include "server/grid/grid.h"

namespace voxeld::volume {

// The place of an array's samples.
struct NrrdData {
  std::string_view encoding;   // "gzip", "raw"
  std::string_view file = {};  // beside the header; empty: they follow it, after an empty line
};

// The header of the array of occupancy (nullopt) or a channel, up to its samples.
std::string nrrd_header(const Grid& grid, std::optional<Channel> channel, const ArrayType& type,
                        const NrrdData& data);

}  // namespace voxeld::volume
