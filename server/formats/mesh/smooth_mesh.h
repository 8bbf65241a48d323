// A smooth closed mesh between the cells inside and outside, by surface nets (Gibson, Constrained
// Elastic Surface Nets, 1998): a vertex for each 2x2x2 cells of both kinds, a quad for each pair of
// adjoining cells of both kinds.
#pragma once

#include <string_view>

#include "proto/result.h"
#include "server/formats/mesh/surface_mesh.h"
#include "server/grid/grid.h"

namespace voxeld::mesh {

// The surface is where the grid's data is best:
//   distance of a band or solid  distance 0; a vertex is the mean of the points at which the edges
//                                between its cells' centres pass that
//   coverage of a solid          half covered; likewise
//   otherwise                    between voxels and empty cells; vertices move towards the mean of
//                                their neighbours, at most half a voxel on each axis
// A vertex has the mean colour of its cells inside. Errors: grid-too-large.
Result<SurfaceMesh> make_smooth_mesh(const Grid& grid, std::string_view format);

}  // namespace voxeld::mesh
