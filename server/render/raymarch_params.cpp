#include "server/render/raymarch_params.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
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

// A section is moved by this part of a voxel to the side that it keeps. Rays then begin behind a
// plane between cells however they are rounded, also in the single precision of the page.
constexpr double kSectionMargin = 1.0 / 256.0;

double largest_of(const glm::dvec3& v) {
  return std::max(v.x, std::max(v.y, v.z));
}

// The power of two that brings a length to about 1. World units may be so large or small that
// floats, and squares of them, overflow or are 0. Products with it are exact.
double unit_scale(double length) {
  return length > 0.0 ? std::ldexp(1.0, std::clamp(-std::ilogb(length), -1000, 1000)) : 1.0;
}

// Planes are at most so many voxels from the grid's corner, which is far outside every grid.
constexpr double kSectionDistanceMax = 1e30;

double smooth_step(double from, double to, double at) {
  const double t = std::clamp((at - from) / (to - from), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

// How much voxels of so many pixels look like cubes, 0..1. Smaller ones shade as a smooth surface.
// A line is there or not: a blueprint changes over sooner.
double cube_share(double voxel_pixels, Style style) {
  return smooth_step(2.0, style == Style::kBlueprint ? 4.0 : 8.0, voxel_pixels);
}

// Edges are this wide, in voxels and in pixels; in small voxels they fade, because they would be
// all that is seen.
constexpr double kEdgeVoxels = 0.05, kEdgePixels = 1.0;
constexpr double kEdgeDarkness = 0.30;
constexpr double kEdgeVoxelPixelsMin = 4.0, kEdgeVoxelPixelsMax = 10.0;

// Lines of a section's hatch to the image's smaller side, and their smallest distance in pixels.
constexpr double kHatchLines = 56.0, kHatchPixelsMin = 5.0;

// The luminance, in linear light, that the median of a dark model's colours gets, and the largest
// factor for that.
constexpr double kMedianLuminance = 0.20, kAutoExposureMax = 4.0;

// The factor of with_exposure() that brings one luminance to the other.
double exposure_of(const PackedGrid& grid, const RenderOptions& options) {
  if (options.exposure) return *options.exposure;
  if (options.style == Style::kIso || !grid.has_color) return 1.0;
  const double at = std::max(grid.luminance, 1e-4);
  const double factor = kMedianLuminance * (1.0 - at) / (at * (1.0 - kMedianLuminance));
  return std::clamp(factor, 1.0, kAutoExposureMax);
}

using Srgb = std::array<uint8_t, 4>;

shared::vec4 linear_color(const Srgb& color) {
  return to_vec4({linear_from_srgb(color[0]), linear_from_srgb(color[1]),
                  linear_from_srgb(color[2]), color[3] / 255.0});
}

constexpr Srgb kLineColor = {226, 236, 250, 255};

// Distance of two points from each other's tangent planes, in voxels, from which there is an
// outline between them: steps of the voxelization are none while voxels stand for a smooth surface.
double outline_depth(double voxel_pixels) {
  const double smooth = 1.8 + 2.5 / voxel_pixels;
  return smooth + (0.2 - smooth) * cube_share(voxel_pixels, Style::kBlueprint);
}

// The floor begins to fade this far from the middle of the box, in halves of its diagonal.
constexpr double kGroundFade = 0.75;

shared::vec4 ground_of(const PackedGrid& grid, const RenderOptions& options, double diagonal) {
  const glm::dvec3 middle = 0.5 * glm::dvec3(grid.occupied_min + grid.occupied_max);
  double y = grid.occupied_min.y;
  if (options.ground_y_world) {
    y = (*options.ground_y_world - grid.spec.origin_world.y) / grid.spec.voxel_size.y;
  }
  return to_vec4({middle.x, y, middle.z, 0.5 * kGroundFade * diagonal});
}

uint32_t flags_of(const PackedGrid& grid, const RenderOptions& options) {
  const bool is_flat = options.style == Style::kIso;
  const auto flag = [](bool on, uint32_t bit) { return on ? bit : 0u; };
  return flag(grid.has_color && options.style != Style::kClay, RAYMARCH_HAS_COLOR) |
         flag(grid.has_normal, RAYMARCH_HAS_NORMAL) |
         flag(options.section.has_value(), RAYMARCH_HAS_SECTION) | flag(!is_flat, RAYMARCH_PHONG) |
         flag(options.style == Style::kSmooth, RAYMARCH_HIGHLIGHT) |
         flag(options.occlusion, RAYMARCH_OCCLUSION) | flag(options.shadow, RAYMARCH_SHADOW) |
         flag(options.ground, RAYMARCH_HAS_GROUND);
}

}  // namespace

glm::dvec4 section_in_grid(const std::array<double, 4>& plane, const GridSpec& spec) {
  glm::dvec3 normal(plane[0], plane[1], plane[2]);
  const double scale = unit_scale(largest_of(glm::abs(normal)));
  normal *= scale;
  const glm::dvec3 in_grid = normal * spec.voxel_size, size = glm::abs(in_grid);
  const double margin = kSectionMargin * (size.x + size.y + size.z);
  const double d = glm::dot(normal, spec.origin_world) + scale * plane[3] + margin;
  const double grid_scale = unit_scale(largest_of(size));
  return {grid_scale * in_grid,
          std::clamp(grid_scale * d, -kSectionDistanceMax, kSectionDistanceMax)};
}

// Every step crosses a plane between cells of the occupied box, and a ray crosses each plane only
// once.
int ray_steps_max(const PackedGrid& grid) {
  const glm::ivec3 size = grid.occupied_max - grid.occupied_min;
  return size.x + size.y + size.z + 8;
}

RaymarchVariant raymarch_variant(const PackedGrid& grid, const RenderOptions& options) {
  const bool light = options.occlusion || options.shadow;
  const bool smooth = options.style != Style::kIso || light;
  return {grid.has_color || grid.has_normal, smooth && !grid.has_normal, light, options.ground,
          options.style == Style::kBlueprint};
}

ImageBackground image_background(const RenderOptions& options) {
  if (options.background) return {*options.background, *options.background};
  switch (options.style) {
    case Style::kVoxel:
    case Style::kClay:
      return {{214, 219, 226, 255}, {250, 251, 252, 255}};
    case Style::kBlueprint:
      return {{22, 58, 112, 255}, {30, 74, 136, 255}};
    case Style::kIso:
      return {{224, 229, 236, 255}, {224, 229, 236, 255}};
    case Style::kSmooth:
      break;
  }
  return {{255, 255, 255, 255}, {255, 255, 255, 255}};
}

Subject subject_of(const PackedGrid& grid) {
  Subject subject{grid.spec.world_from_grid(glm::dvec3(grid.occupied_min)),
                  grid.spec.world_from_grid(glm::dvec3(grid.occupied_max)),
                  {}};
  subject.points_world.reserve(grid.hull.size());
  for (const glm::ivec3& p : grid.hull) {
    subject.points_world.push_back(grid.spec.world_from_grid(glm::dvec3(p)));
  }
  return subject;
}

int wanted_samples(const RenderOptions& options, const RenderQuality& quality) {
  if (options.samples > 0) return options.samples;
  const int64_t pixels = int64_t{options.width} * options.height;
  return pixels > quality.supersampled_pixels_max ? 1 : quality.samples_per_side;
}

Result<shared::RaymarchParams> raymarch_params(const PackedGrid& grid, const RenderOptions& options,
                                               int samples) {
  const Subject subject = subject_of(grid);
  const glm::dvec3 &low = subject.low_world, &high = subject.high_world;
  VOXELD_ASSIGN(const ImageRays rays,
                image_rays(make_camera(options, subject), grid.spec, 0.5 * (low + high)));
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
  const double voxel_max = largest_of(voxel);
  block.voxel_size = to_vec4(unit_scale(voxel_max) * glm::dvec4(voxel, voxel_max));
  // The light comes over the viewer's right shoulder, so that visible faces are lit and still show
  // relief.
  const double voxel_pixels = voxel_max / rays.world_per_pixel(options.width);
  const double cubes = cube_share(voxel_pixels, options.style);
  const bool is_voxel = options.style == Style::kVoxel,
             is_outline = options.style == Style::kBlueprint;
  const double face_share_max =
      is_voxel || is_outline ? RAYMARCH_CUBE_FACE_SHARE : RAYMARCH_FACE_SHARE;
  block.light_world = to_vec4(glm::dvec4(
      glm::normalize(rays.to_eye + 0.45 * rays.right + 0.65 * rays.up), face_share_max * cubes));
  const ImageBackground background = image_background(options);
  block.background = linear_color(background.bottom);
  block.background_top = linear_color(background.top);
  block.line = linear_color(kLineColor);
  block.line.w = static_cast<float>(outline_depth(voxel_pixels));
  if (const auto& full = grid.full_color) {
    block.full_color = to_vec4({linear_from_srgb((*full)[0]), linear_from_srgb((*full)[1]),
                                linear_from_srgb((*full)[2]), 1.0});
  }
  const Footprint footprint = pixel_footprint(rays, options.width, options.height, voxel);
  const double diagonal = glm::length((high - low) / voxel_max);
  block.footprint = to_vec4({footprint.at_near, footprint.per_distance,
                             std::max(kOcclusionVoxelsMin, kOcclusionLength * diagonal), cubes});
  const double edges =
      is_voxel ? smooth_step(kEdgeVoxelPixelsMin, kEdgeVoxelPixelsMax, voxel_pixels) : 0.0;
  block.tone =
      to_vec4({exposure_of(grid, options), std::max(kEdgeVoxels, kEdgePixels / voxel_pixels),
               kEdgeDarkness * edges,
               std::max(kHatchPixelsMin, std::min(options.width, options.height) / kHatchLines)});
  block.ground = ground_of(grid, options, diagonal);
  const glm::ivec3 box_low = grid.occupied_min, box_high = grid.occupied_max;
  block.box_low = {box_low.x, box_low.y, box_low.z, ray_steps_max(grid)};
  block.box_high = {box_high.x, box_high.y, box_high.z, samples};
  block.tile_dims = {grid.tile_dims.x, grid.tile_dims.y, grid.tile_dims.z, 0};
  block.image = {options.width, options.height, static_cast<int32_t>(flags_of(grid, options)), 0};
  return block;
}

}  // namespace voxeld
