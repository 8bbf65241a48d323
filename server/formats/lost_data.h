// Warnings about data of a grid that its file does not hold.
#pragma once

#include <string>
#include <vector>

#include "proto/messages/job.h"
#include "proto/options/options.h"
#include "server/grid/grid.h"

namespace voxeld {

// Warnings of volumes and points:
//   lost-channels      channels without a place; an array holds one, which `channel` names
//   lost-alpha         transparent voxels, where the file has no alpha
//   lost-names         ids without the names of labels or materials
//   lost-units         units that the format has no word for
//   lost-placement     no origin and voxel size
//   lost-precision     floats too coarse for the origin
//   not-cubes          voxels that are no cubes, where the file has one size
//   distance-in-voxels voxels that are no cubes and no distance=world, so distances are in voxels
// A grid without tiles, that of a sequence, has no lost-alpha.
std::vector<Warning> lost_data_warnings(const Grid& grid, const OutputOptions& options);

// The names of channels, with commas between them.
std::string joined_names(const ChannelSet& channels);
// Whether a voxel with a colour of its own is not opaque.
bool has_alpha(const Grid& grid);

// Whether MetaImage (.mha) and NIfTI (.nii) have a word for these units.
inline bool has_mha_units(const std::string& units) {
  return units == "mm" || units == "cm";
}
inline bool has_nii_units(const std::string& units) {
  return units == "m" || units == "mm";
}

}  // namespace voxeld
