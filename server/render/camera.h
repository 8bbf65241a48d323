// Where a picture is taken from.
#pragma once

#include <array>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "proto/options.h"
#include "proto/result.h"
#include "server/grid/grid_spec.h"

namespace voxeld {

// Perspective pictures show this angle over their smaller side, in degrees.
inline constexpr double kFieldOfViewDeg = 35.0;

// world space -> clip space of OpenGL (y up, z in -1..1).
struct Camera {
  glm::dmat4 clip_from_world{1.0};
};

// As RenderOptions::matrix has it.
std::array<double, 16> row_major(const glm::dmat4& matrix);

// Frames the occupied box: at zoom 1 its bounding sphere fits the smaller side of the picture. Zoom
// magnifies about the middle of the picture and moves nothing, so perspective does not change and
// the camera never enters the grid. A matrix in the options is taken as it is.
Camera make_camera(const RenderOptions& options, const glm::dvec3& occupied_min_world,
                   const glm::dvec3& occupied_max_world);

// What the ray march needs of a camera, in grid space; see shaders/shared/raymarch.h.
struct PictureRays {
  // Homogeneous points of the near and far plane: at[0] + x * at[1] + y * at[2], clip x and y.
  glm::dvec4 near_plane[3], far_plane[3];
  // World-space unit vectors at the middle of the picture.
  glm::dvec3 right{1, 0, 0}, up{0, 1, 0}, to_eye{0, 0, 1};
  // World units from side to side of the picture, at the depth of the subject.
  double width_world = 1.0;
  double world_per_pixel(int width_pixels) const { return width_world / width_pixels; }
};
// `subject_world` is the point that sizes are told for. Errors: invalid-option when the matrix
// cannot be inverted.
Result<PictureRays> picture_rays(const Camera& camera, const GridSpec& spec,
                                 const glm::dvec3& subject_world);

// How much of the grid a pixel in the middle of the picture spans, in sides of a voxel, the longest
// of the three; all distances in that unit too.
struct Footprint {
  double at_near = 0.0;       // at the near plane
  double per_distance = 0.0;  // what is added for each unit of distance from it; >= 0
};
// The smaller of the spans across and down; where the far side spans less than the near one, its
// span everywhere.
Footprint pixel_footprint(const PictureRays& rays, int width, int height,
                          const glm::dvec3& voxel_size);

}  // namespace voxeld
