#include "server/render/camera.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/matrix_access.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <map>

#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

// The depth range is slightly larger than the bounding sphere, so that the near and far plane cut
// no corner.
constexpr double kDepthMargin = 1.01;

glm::dmat4 from_row_major(const std::array<double, 16>& rows) {
  glm::dmat4 matrix;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      matrix[column][row] = rows[4 * static_cast<size_t>(row) + static_cast<size_t>(column)];
    }
  }
  return matrix;
}

// An orthonormal, right-handed view. At the poles "up" is the limit.
glm::dmat4 view_from_world(double azimuth, double elevation, const glm::dvec3& eye) {
  const double sa = std::sin(azimuth), ca = std::cos(azimuth);
  const double se = std::sin(elevation), ce = std::cos(elevation);
  const glm::dvec3 right(ca, 0.0, -sa);
  const glm::dvec3 up(-sa * se, ce, -ca * se);
  const glm::dvec3 back(sa * ce, se, ca * ce);
  glm::dmat4 view(1.0);
  view = glm::row(view, 0, glm::dvec4(right, -glm::dot(right, eye)));
  view = glm::row(view, 1, glm::dvec4(up, -glm::dot(up, eye)));
  view = glm::row(view, 2, glm::dvec4(back, -glm::dot(back, eye)));
  return view;
}

// Circles through the points around the vertical axis through `center`, as polygons around them.
// They begin at the camera's azimuth, so that a camera at any azimuth sees the same. The largest
// circle of a height holds the others, which are left out: the tiles of a large grid have millions
// of corners at some hundred heights.
std::vector<glm::dvec3> turned(const std::vector<glm::dvec3>& points, const glm::dvec3& center,
                               double azimuth) {
  constexpr int kCorners = 32;
  std::map<double, double> radii;  // by height
  for (const glm::dvec3& p : points) {
    cancel_point();
    double& radius = radii[p.y];
    radius = std::max(radius, std::hypot(p.x - center.x, p.z - center.z));
  }
  std::vector<glm::dvec3> all;
  all.reserve(radii.size() * kCorners);
  for (const auto& [height, inner_radius] : radii) {
    const double radius = inner_radius / std::cos(glm::pi<double>() / kCorners);
    for (int i = 0; i < kCorners; ++i) {
      const double angle = azimuth + 2.0 * glm::pi<double>() * i / kCorners;
      all.emplace_back(center.x + radius * std::sin(angle), height,
                       center.z + radius * std::cos(angle));
    }
  }
  return all;
}

// Clip space to clip space: puts the image of the points into the middle, at kFrameShare of the
// width or height. Identity without points.
glm::dmat4 fit_to(const std::vector<glm::dvec3>& points, const glm::dmat4& clip_from_world) {
  glm::dvec2 low(std::numeric_limits<double>::max()), high(-low);
  for (const glm::dvec3& p : points) {
    cancel_point();
    const glm::dvec4 clip = clip_from_world * glm::dvec4(p, 1.0);
    const glm::dvec2 at(clip.x / clip.w, clip.y / clip.w);
    low = glm::min(low, at);
    high = glm::max(high, at);
  }
  glm::dmat4 fit(1.0);
  if (points.empty()) return fit;
  const double scale =
      2.0 * kFrameShare / std::max(std::max(high.x - low.x, high.y - low.y), 1e-300);
  const glm::dvec2 middle = 0.5 * (low + high);
  fit[0][0] = fit[1][1] = scale;
  fit[3] = glm::dvec4(-scale * middle, 0.0, 1.0);  // times w: the same shift at every depth
  return fit;
}

}  // namespace

Subject box_subject(const glm::dvec3& low_world, const glm::dvec3& high_world) {
  Subject subject{low_world, high_world, {}};
  for (int i = 0; i < 8; ++i) {
    subject.points_world.emplace_back((i & 1) != 0 ? high_world.x : low_world.x,
                                      (i & 2) != 0 ? high_world.y : low_world.y,
                                      (i & 4) != 0 ? high_world.z : low_world.z);
  }
  return subject;
}

std::array<double, 16> row_major(const glm::dmat4& matrix) {
  std::array<double, 16> rows{};
  for (size_t i = 0; i < rows.size(); ++i) {
    rows[i] = matrix[static_cast<int>(i % 4)][static_cast<int>(i / 4)];
  }
  return rows;
}

Camera make_camera(const RenderOptions& options, const Subject& subject) {
  if (options.matrix) return Camera{from_row_major(*options.matrix)};
  const glm::dvec3 center = 0.5 * (subject.low_world + subject.high_world);
  const double radius = std::max(0.5 * glm::length(subject.high_world - subject.low_world), 1e-300);
  const double azimuth = glm::radians(options.azimuth_deg);
  const double elevation = glm::radians(options.elevation_deg);
  const bool is_perspective = options.projection == Projection::kPerspective;
  const double half_angle = glm::radians(0.5 * kFieldOfViewDeg);
  // A sphere fills the angle if the sides of the frustum are tangent to it.
  const double distance = is_perspective ? radius / std::sin(half_angle) : 2.0 * radius;
  const glm::dvec3 back(std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                        std::cos(azimuth) * std::cos(elevation));
  const double near = distance - kDepthMargin * radius, far = distance + kDepthMargin * radius;
  const double shorter = std::min(options.width, options.height);
  const double scale_x = shorter / options.width;
  const double scale_y = shorter / options.height;

  glm::dmat4 clip_from_view(0.0);
  if (is_perspective) {
    const double focal = 1.0 / std::tan(half_angle);
    clip_from_view[0][0] = focal * scale_x;
    clip_from_view[1][1] = focal * scale_y;
    clip_from_view[2][2] = (far + near) / (near - far);
    clip_from_view[3][2] = 2.0 * far * near / (near - far);
    clip_from_view[2][3] = -1.0;
  } else {
    clip_from_view[0][0] = scale_x / radius;
    clip_from_view[1][1] = scale_y / radius;
    clip_from_view[2][2] = 2.0 / (near - far);
    clip_from_view[3][2] = (far + near) / (near - far);
    clip_from_view[3][3] = 1.0;
  }
  const glm::dmat4 clip_from_world =
      clip_from_view * view_from_world(azimuth, elevation, center + distance * back);
  const bool is_turned = options.turntable > 0;
  const glm::dmat4 fit =
      fit_to(is_turned ? turned(subject.points_world, center, azimuth) : subject.points_world,
             clip_from_world);
  const glm::dmat4 zoom = glm::scale(glm::dmat4(1.0), glm::dvec3(options.zoom, options.zoom, 1.0));
  return Camera{zoom * fit * clip_from_world};
}

Result<ImageRays> image_rays(const Camera& camera, const GridSpec& spec,
                             const glm::dvec3& subject_world) {
  const glm::dmat4 world_from_grid =
      glm::scale(glm::translate(glm::dmat4(1.0), spec.origin_world), spec.voxel_size);
  const glm::dmat4 clip_from_grid = camera.clip_from_world * world_from_grid;
  const glm::dmat4 grid_from_clip = glm::inverse(clip_from_grid);
  const glm::dmat4 product = clip_from_grid * grid_from_clip;
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) {
      const double wanted = column == row ? 1.0 : 0.0;
      // The comparison also fails for NaN and infinity.
      if (!(std::abs(product[column][row] - wanted) < 1e-3)) {
        return Error{ErrorCode::kInvalidOption, "matrix cannot be inverted",
                     "an invertible clip_from_world of moderate numbers", "a singular matrix"};
      }
    }
  }
  const auto at = [&](double x, double y, double z, double w) {
    return grid_from_clip * glm::dvec4(x, y, z, w);
  };
  ImageRays rays{{at(0, 0, -1, 1), at(1, 0, 0, 0), at(0, 1, 0, 0)},
                 {at(0, 0, 1, 1), at(1, 0, 0, 0), at(0, 1, 0, 0)},
                 {},
                 {},
                 {},
                 1.0};
  const auto world_at = [&](double x, double y, double z) {
    const glm::dvec4 p = world_from_grid * at(x, y, z, 1);
    return glm::dvec3(p) / p.w;
  };
  // Points inside the frustum are used, because a perspective far plane may be at infinity.
  const glm::dvec3 middle = world_at(0, 0, 0);
  rays.to_eye = glm::normalize(world_at(0, 0, -1) - middle);
  rays.right = glm::normalize(world_at(1e-3, 0, 0) - middle);
  rays.up = glm::normalize(world_at(0, 1e-3, 0) - middle);
  const glm::dvec4 subject_clip = camera.clip_from_world * glm::dvec4(subject_world, 1.0);
  const double depth = std::clamp(subject_clip.z / subject_clip.w, -1.0, 1.0);
  rays.width_world = glm::length(world_at(1, 0, depth) - world_at(-1, 0, depth));
  return rays;
}

Footprint pixel_footprint(const ImageRays& rays, int width, int height,
                          const glm::dvec3& voxel_size) {
  const double longest = std::max(voxel_size.x, std::max(voxel_size.y, voxel_size.z));
  // A point of the image in the near plane, or halfway to the far plane. Halfway in clip depth,
  // because the far plane may be at infinity.
  const auto at = [&](double depth, double x, double y) {
    const auto on = [&](const glm::dvec4(&plane)[3]) {
      return plane[0] + x * plane[1] + y * plane[2];
    };
    const glm::dvec4 p = on(rays.near_plane) * (1.0 - depth) + on(rays.far_plane) * depth;
    return glm::dvec3(p) / p.w * voxel_size / longest;
  };
  const auto span = [&](double depth) {
    const glm::dvec3 middle = at(depth, 0, 0);
    return std::min(glm::length(at(depth, 2.0 / width, 0) - middle),
                    glm::length(at(depth, 0, 2.0 / height) - middle));
  };
  const double near = span(0.0), far = span(0.5);
  const double distance = glm::length(at(0.5, 0, 0) - at(0.0, 0, 0));
  if (!(far > near) || !(distance > 0.0)) return {std::min(near, far), 0.0};
  return {near, (far - near) / distance};
}

}  // namespace voxeld
