// What of a grid a camera sees, and how large its voxels are in the picture.
#pragma once

#include <array>
#include <optional>

#include <glm/mat4x4.hpp>

#include "proto/options.h"
#include "server/grid/grid_spec.h"
#include "server/grid/tile_source.h"

namespace voxeld {

class PictureView {
 public:
  // options.matrix is the camera.
  PictureView(const RenderOptions& options, const GridSpec& spec);

  // Whether some of the cells [low, high) may be in the picture: false where all of them are
  // outside of one plane of the frustum, or cut away by the section.
  bool sees(const CellBox& cells) const;
  // The most pixels that a step of one cell along an axis spans in the picture, at the corners of
  // the box; infinite where one is not in front of the camera.
  double cell_pixels(const CellBox& cells) const;

 private:
  glm::dmat4 clip_from_grid_;
  std::optional<glm::dvec4> section_;  // positive where it is cut away; in grid space
  double half_width_, half_height_;    // of the picture
};

// The coarsest level whose voxels are at most kLevelPixelsMax wide where a cell has cell_pixels.
// What is smaller than that the renderer draws as one anyway (server/render/README.md).
inline constexpr double kLevelPixelsMax = 0.7;
int level_of_pixels(double cell_pixels);

}  // namespace voxeld
