// A closed mesh of the outer faces of voxels.
#pragma once

#include <span>
#include <string_view>

#include "proto/result.h"
#include "server/formats/mesh/rectangles.h"
#include "server/formats/mesh/surface_mesh.h"

namespace voxeld::mesh {

// Corners of rectangles that lie on an edge of another one become vertices of that one too, so the
// mesh has no T-junctions. A rectangle with just four vertices is a quad, another one a set of
// triangles. Vertices are shared by faces of one colour. Errors: grid-too-large.
Result<SurfaceMesh> mesh_of_rectangles(const VoxelBricks& voxels,
                                       std::span<const RectangleSlab> slabs, bool has_colors,
                                       std::string_view format);

}  // namespace voxeld::mesh
