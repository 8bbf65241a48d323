// The voxels that have an outer face, for cubes that a viewer draws.
#pragma once

#include <string_view>

#include "proto/result.h"
#include "server/formats/mesh/surface_mesh.h"
#include "server/grid/grid.h"

namespace voxeld::mesh {

// Cubes of a mesh; those of 2^27 take 2 GiB. More: grid-too-large.
inline constexpr uint64_t kCubesMax = uint64_t{1} << 27;

// Their centres in cells and their colours, tile by tile, by bricks and then by z, y and x.
// Errors: grid-too-large for more than `count_max`, which names the format.
Result<UnsetArray<Vertex>> outer_voxels(const Grid& grid, std::string_view format,
                                        uint64_t count_max = kCubesMax);

}  // namespace voxeld::mesh
