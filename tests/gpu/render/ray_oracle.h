// What a ray hits, in double precision with naive loops; shares nothing with the shader.
#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "server/grid/grid.h"
#include "server/render/render.h"

namespace voxeld {

// Grid space; the ray is origin + t * direction for t in [t_min, t_max].
struct OracleRay {
  glm::dvec3 origin{0.0}, direction{0.0};
  double t_min = 0.0, t_max = 1.0;
};

// From the near to the far plane under the middle of pixel (x, y), y counted from the top, on the
// kept side of the section plane.
OracleRay oracle_ray(const RenderOptions& options, const glm::dmat4& clip_from_world,
                     const GridSpec& spec, int x, int y);

// Dense occupancy, x fastest.
class OracleGrid {
 public:
  explicit OracleGrid(const Grid& grid);
  // Amanatides & Woo (1987), with distances computed from the cell each time.
  Hit march(const OracleRay& ray) const;
  bool occupied(const glm::ivec3& cell) const;

 private:
  glm::ivec3 dims_;
  std::vector<bool> cells_;
};

// Length in cells of the ray inside the cell grown by `margin` on all sides; negative: it misses.
double chord(const OracleRay& ray, const glm::ivec3& cell, double margin);

}  // namespace voxeld
