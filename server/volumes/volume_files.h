// The readers of the formats; volume.h chooses among them.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "proto/result.h"
#include "server/volumes/volume.h"

namespace voxeld::volumes {

// MagicaVoxel, versions 150 and 200: the models of all shapes of the scene that are not hidden, at
// the places and in the directions of their transforms, of an animation those of the first frame.
// The first model in the order of the graph shows where models overlap. Channel color.
Result<Volume> read_vox(std::string_view name, std::span<const uint8_t> bytes);
// Occupancy in its place: translate and scale.
Result<Volume> read_binvox(std::string_view name, std::span<const uint8_t> bytes);
// An array of three axes z, y, x; or of four, whose last one has 3 or 4 components: colours, which
// are occupied if alpha or, without alpha, any of them is not 0.
Result<Volume> read_npy(std::string_view name, std::span<const uint8_t> bytes, double threshold);
// Likewise, in the order and at the place that the header tells.
Result<Volume> read_nrrd(std::string_view name, std::span<const uint8_t> bytes, double threshold);

}  // namespace voxeld::volumes
