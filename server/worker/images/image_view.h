// The part of a grid that a camera sees, and the size of its voxels in the image.
#pragma once

#include <array>
#include <optional>

#include <glm/mat4x4.hpp>

#include "proto/options/options.h"
#include "server/grid/grid_spec.h"
#include "server/grid/tile_source.h"

namespace voxeld {

class ImageView {
 public:
  // options.matrix is the camera.
  ImageView(const RenderOptions& options, const GridSpec& spec);

  // Whether some of the cells [low, high) may be in the image. False if all of them are outside one
  // plane of the frustum, or cut away by the section.
  bool sees(const CellBox& cells) const;
  // The most pixels that a step of one cell along an axis spans in the image, at the corners of the
  // box. Infinite if a corner is not in front of the camera.
  double cell_pixels(const CellBox& cells) const;

 private:
  glm::dmat4 clip_from_grid_;
  std::optional<glm::dvec4> section_;  // positive in the part that is cut away; in grid space
  double half_width_, half_height_;    // of the image
};

// The coarsest level whose voxels are at most kLevelPixelsMax pixels wide, if a cell is cell_pixels
// wide. The renderer draws smaller voxels as one anyway (server/render/README.md).
inline constexpr double kLevelPixelsMax = 0.7;
int level_of_pixels(double cell_pixels);

}  // namespace voxeld
