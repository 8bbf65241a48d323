// The hit of a ray, in double precision with naive loops; shares nothing with the shader.
#pragma once

#include <bitset>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <unordered_map>
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

// Occupied cells in hash tables, by tile and brick.
class OracleGrid {
 public:
  explicit OracleGrid(const Grid& grid);
  // Amanatides & Woo (1987), with distances computed from the cell each time.
  Hit march(const OracleRay& ray) const;
  // Cells [low, high) are the box of the occupied ones.
  const glm::ivec3& low() const { return low_; }
  const glm::ivec3& high() const { return high_; }

 private:
  struct Box {
    glm::ivec3 low, high;
  };
  struct Tile {
    std::vector<Box> full;
    std::unordered_map<uint64_t, std::bitset<512>> bricks;
  };
  void add_box(const glm::ivec3& low, const glm::ivec3& high);
  void add_tile(const SparseTile& source);
  const Tile* find_tile(const glm::ivec3& cell) const;
  static bool occupied(const Tile& tile, const glm::ivec3& cell);

  glm::ivec3 dims_, low_{1 << 30}, high_{0};
  std::unordered_map<uint64_t, Tile> tiles_;
};

// Length in cells of the ray inside the cell grown by `margin` on all sides; negative: it misses.
double chord(const OracleRay& ray, const glm::ivec3& cell, double margin);

}  // namespace voxeld
