// What channels of ids number: materials, meshes, nodes or groups of the file. README.md says which
// id a voxel has.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "proto/options.h"
#include "proto/result.h"
#include "server/scene/scene.h"
#include "server/voxel/id_fold.h"

namespace voxeld {

// Ids of this many are few enough for a device to sum each on its own; see IdChannel::is_wide.
inline constexpr size_t kIdsOnDeviceMax = 16;

// The names of ids 1, 2, …, as the file gives them; not all are in a grid.
std::vector<std::string> id_names(const Scene& scene, LabelKind kind);

// The id of each part: for channel material, for channel label, what of `labels`, and for channel
// colour, as color=dominant needs them, the materials. Errors: invalid-option for more than 16 bits
// of ids, or parts that the file's limit has merged.
Result<IdChannel> id_channel(const Scene& scene, Channel channel, LabelKind labels);

}  // namespace voxeld
