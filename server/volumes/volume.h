// Reads files of voxels as grids: native containers, MagicaVoxel, binvox, NumPy arrays, NRRD.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/messages/job.h"
#include "proto/result.h"
#include "server/grid/grid.h"

namespace voxeld {

enum class VolumeFormat { kContainer, kVox, kBinvox, kNpy, kNrrd };

// The format whose first bytes these are. The name of the file does not matter.
std::optional<VolumeFormat> detect_volume(std::span<const uint8_t> bytes);
// "voxg", "vox", "binvox", "npy", "nrrd".
std::string_view volume_format_name(VolumeFormat format);

struct Volume {
  Grid grid;  // its meta is empty, but for that of a container
  std::vector<Warning> warnings;
};

// Reads a file that detect_volume() knows. `name` appears in errors. threshold: the least sample
// that makes a voxel, of formats with samples. Memory follows the voxels, not the cells. Errors:
// malformed-mesh for a file that breaks its format's rules, with the place; unsupported-feature for
// what is not read; grid-too-large for more than limits::kGridSideMax cells on a side or
// limits::kSparseVoxelsMax voxels, of which a full brick of a container counts as one.
Result<Volume> load_volume(std::string_view name, std::span<const uint8_t> bytes, double threshold);

}  // namespace voxeld
