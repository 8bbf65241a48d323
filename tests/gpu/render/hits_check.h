// Compares what the ray march hits with what the oracle hits.
#pragma once

#include <string>

#include "server/grid/grid.h"
#include "server/render/render.h"
#include "tests/gpu/render/ray_oracle.h"

namespace voxeld {

// The one that the tests share, on the context of the test.
Renderer& hits_renderer();

std::string text(const Hit& hit);
GridSpec spec_of(const glm::ivec3& dims, const glm::dvec3& voxel_size);
RenderOptions options_of(int width, int height, double azimuth, double elevation);

// Cells. A ray of single precision may pass on the other side of an edge that it comes closer to
// than this: over 300 cells it is off by 3e-5, and a step multiplies two such numbers.
inline constexpr double kEdge = 1e-3;

// The renderer holds `grid`. Every pixel must agree, but for rays closer to an edge than
// `edge_cells`, of which there may be few. Returns the number of rays that hit anything.
int expect_same_hits(const RenderOptions& options, const Grid& grid, double edge_cells = kEdge);
int expect_same_hits(const RenderOptions& options, const Grid& grid, const OracleGrid& oracle,
                     double edge_cells);

}  // namespace voxeld
