// The ids of materials, meshes, nodes or groups of a file, as channels of ids store them. README.md
// defines which id a voxel has.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/scene/core/scene.h"
#include "server/voxel/attributes/id_fold.h"

namespace voxeld {

// The most ids that a device sums in separate passes; see IdChannel::is_wide.
inline constexpr size_t kIdsOnDeviceMax = 16;

// The names of ids 1, 2, … as the file gives them. A grid need not contain every one of them.
std::vector<std::string> id_names(const Scene& scene, LabelKind kind);

// The id of each part. Channel label numbers what `labels` says. Channel material numbers
// materials, and so does channel colour, for color=dominant. Errors: invalid-option if ids exceed
// 16 bits, or if the file's limit has merged parts.
Result<IdChannel> id_channel(const Scene& scene, Channel channel, LabelKind labels);

}  // namespace voxeld
