#include "server/render/raymarch_params.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "server/render/camera.h"

namespace voxeld {
namespace {

// Length of ambient occlusion rays, as a fraction of the diagonal of the occupied box, and its
// minimum in voxels.
constexpr double kOcclusionLength = 0.06;
constexpr double kOcclusionVoxelsMin = 6.0;

shared::vec4 to_vec4(const glm::dvec4& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z),
          static_cast<float>(v.w)};
}

// The digits for which a float has no room.
shared::vec4 low_part(const glm::dvec4& v) {
  return to_vec4(v - glm::dvec4(glm::vec4(v)));
}

void split(const glm::dvec4& v, shared::vec4& leading, shared::vec4& rest) {
  leading = to_vec4(v);
  rest = low_part(v);
}

double linear_from_srgb(uint8_t value) {
  const double c = value / 255.0;
  return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
}

// Converts a world plane to a grid plane.
glm::dvec4 section_in_grid(const std::array<double, 4>& plane, const GridSpec& spec) {
  const glm::dvec3 normal(plane[0], plane[1], plane[2]);
  return {normal * spec.voxel_size, glm::dot(normal, spec.origin_world) + plane[3]};
}

// The share of the hit face's normal in a normal that is estimated from the neighbourhood. It grows
// with the width of a voxel in pixels: voxels of a few pixels shade as a smooth surface, larger
// ones look like cubes.
double face_share(double voxel_pixels) {
  const double t = std::clamp((voxel_pixels - 2.0) / 6.0, 0.0, 1.0);
  return RAYMARCH_FACE_SHARE * t * t * (3.0 - 2.0 * t);
}

}  // namespace

// Every step crosses a plane between cells of the occupied box, and a ray crosses each plane only
// once.
int ray_steps_max(const PackedGrid& grid) {
  const glm::ivec3 size = grid.occupied_max - grid.occupied_min;
  return size.x + size.y + size.z + 8;
}

RaymarchVariant raymarch_variant(const PackedGrid& grid, const RenderOptions& options) {
  const bool light = options.occlusion || options.shadow;
  const bool smooth = options.light == Light::kPhong || light;
  return {grid.has_color || grid.has_normal, smooth && !grid.has_normal, light};
}

int wanted_samples(const RenderOptions& options, const RenderQuality& quality) {
  if (options.samples > 0) return options.samples;
  const int64_t pixels = int64_t{options.width} * options.height;
  return pixels > quality.supersampled_pixels_max ? 1 : quality.samples_per_side;
}

Result<shared::RaymarchParams> raymarch_params(const PackedGrid& grid, const RenderOptions& options,
                                               int samples) {
  const glm::dvec3 low = grid.spec.world_from_grid(glm::dvec3(grid.occupied_min));
  const glm::dvec3 high = grid.spec.world_from_grid(glm::dvec3(grid.occupied_max));
  VOXELD_ASSIGN(const ImageRays rays,
                image_rays(make_camera(options, low, high), grid.spec, 0.5 * (low + high)));
  shared::RaymarchParams block;
  split(rays.near_plane[0], block.near_0, block.near_0_low);
  split(rays.near_plane[1], block.near_x, block.near_x_low);
  split(rays.near_plane[2], block.near_y, block.near_y_low);
  split(rays.far_plane[0], block.far_0, block.far_0_low);
  split(rays.far_plane[1], block.far_x, block.far_x_low);
  split(rays.far_plane[2], block.far_y, block.far_y_low);
  if (options.section) {
    split(section_in_grid(*options.section, grid.spec), block.section, block.section_low);
  }
  const glm::dvec3 voxel = grid.spec.voxel_size;
  const double voxel_max = std::max(voxel.x, std::max(voxel.y, voxel.z));
  block.voxel_size = to_vec4(glm::dvec4(voxel, voxel_max));
  // The light comes over the viewer's right shoulder, so that visible faces are lit and still show
  // relief.
  block.light_world =
      to_vec4(glm::dvec4(glm::normalize(rays.to_eye + 0.45 * rays.right + 0.65 * rays.up),
                         face_share(voxel_max / rays.world_per_pixel(options.width))));
  block.background =
      to_vec4({linear_from_srgb(options.background[0]), linear_from_srgb(options.background[1]),
               linear_from_srgb(options.background[2]), options.background[3] / 255.0});
  if (const auto& full = grid.full_color) {
    block.full_color = to_vec4({linear_from_srgb((*full)[0]), linear_from_srgb((*full)[1]),
                                linear_from_srgb((*full)[2]), 1.0});
  }
  const Footprint footprint = pixel_footprint(rays, options.width, options.height, voxel);
  const double diagonal = glm::length((high - low) / voxel_max);
  block.footprint = to_vec4({footprint.at_near, footprint.per_distance,
                             std::max(kOcclusionVoxelsMin, kOcclusionLength * diagonal), 0.0});
  const glm::ivec3 box_low = grid.occupied_min, box_high = grid.occupied_max;
  block.box_low = {box_low.x, box_low.y, box_low.z, ray_steps_max(grid)};
  block.box_high = {box_high.x, box_high.y, box_high.z, samples};
  block.tile_dims = {grid.tile_dims.x, grid.tile_dims.y, grid.tile_dims.z, 0};
  const uint32_t flags =
      (grid.has_color ? RAYMARCH_HAS_COLOR : 0u) | (grid.has_normal ? RAYMARCH_HAS_NORMAL : 0u) |
      (options.section ? RAYMARCH_HAS_SECTION : 0u) |
      (options.light == Light::kPhong ? RAYMARCH_PHONG : 0u) |
      (options.occlusion ? RAYMARCH_OCCLUSION : 0u) | (options.shadow ? RAYMARCH_SHADOW : 0u);
  block.image = {options.width, options.height, static_cast<int32_t>(flags), 0};
  return block;
}

}  // namespace voxeld
