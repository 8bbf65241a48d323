// The camera of an image, and the rays that follow from it.
#pragma once

#include <array>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/grid/grid_spec.h"

namespace voxeld {

// The angle, in degrees, under which a perspective camera sees the sphere around its subject.
inline constexpr double kFieldOfViewDeg = 35.0;
// The share of the image's width or height, whichever is reached first, that the subject takes at
// zoom 1.
inline constexpr double kFrameShare = 0.92;

// Maps world space to the clip space of OpenGL (y up, z in -1..1).
struct Camera {
  glm::dmat4 clip_from_world{1.0};
};

// The matrix in the order of RenderOptions::matrix.
std::array<double, 16> row_major(const glm::dmat4& matrix);

// The thing that an image frames.
struct Subject {
  glm::dvec3 low_world{0.0}, high_world{0.0};  // a box around it
  std::vector<glm::dvec3> points_world;        // their convex hull holds it
};
// All of a box.
Subject box_subject(const glm::dvec3& low_world, const glm::dvec3& high_world);

// Frames the subject: at zoom 1 the image of its points is in the middle and takes kFrameShare of
// the width or the height. With `turntable` that is so for the solid that the points describe
// around the vertical axis, so that the subject neither moves nor changes its size from view to
// view. The camera stands where the sphere around the box fills kFieldOfViewDeg; fit and zoom
// magnify and shift the image. Perspective is therefore the same at every angle, and the camera
// never enters the subject. A matrix in the options is used unchanged. Has cancellation points.
Camera make_camera(const RenderOptions& options, const Subject& subject);

// A camera in grid space, as the ray march needs it; see shaders/shared/raymarch.h.
struct ImageRays {
  // Homogeneous points of the near and far plane: at[0] + x * at[1] + y * at[2], clip x and y.
  glm::dvec4 near_plane[3], far_plane[3];
  // World-space unit vectors at the middle of the image.
  glm::dvec3 right{1, 0, 0}, up{0, 1, 0}, to_eye{0, 0, 1};
  // Width of the image in world units, at the depth of the subject.
  double width_world = 1.0;
  double world_per_pixel(int width_pixels) const { return width_world / width_pixels; }
};
// subject_world: the point at whose depth sizes are measured. Errors: invalid-option if the matrix
// cannot be inverted.
Result<ImageRays> image_rays(const Camera& camera, const GridSpec& spec,
                             const glm::dvec3& subject_world);

// The part of the grid that a pixel in the middle of the image spans, in sides of a voxel. The
// longest of a voxel's three sides is meant; distances use the same unit.
struct Footprint {
  double at_near = 0.0;       // at the near plane
  double per_distance = 0.0;  // growth per unit of distance from it; >= 0
};
// The smaller of the spans across and down. If the far side spans less than the near one, its span
// is used everywhere.
Footprint pixel_footprint(const ImageRays& rays, int width, int height,
                          const glm::dvec3& voxel_size);

}  // namespace voxeld
