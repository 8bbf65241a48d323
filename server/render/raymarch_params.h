// The parameters of a ray march, which the GL and the CPU renderer share.
#pragma once

#include <array>
#include <cstdint>

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/render/camera.h"
#include "server/render/packed_grid.h"
#include "server/render/render.h"
#include "shaders/shared/raymarch.h"

namespace voxeld {

// An upper bound of the steps that a ray through the grid takes.
int ray_steps_max(const PackedGrid& grid);

// The parts of the ray march that an image needs; the others are compiled out
// (shaders/raymarch.frag).
struct RaymarchVariant {
  bool attributes = false;  // voxels have colours or normals
  bool smooth = false;      // normals are estimated
  bool light = false;       // ambient occlusion or a shadow is on
  bool ground = false;      // there is a floor
  bool outline = false;     // outlines alone
};
RaymarchVariant raymarch_variant(const PackedGrid& grid, const RenderOptions& options);

// The background, sRGB with straight alpha, at the image's lower and upper edge: the options' or
// the style's.
struct ImageBackground {
  std::array<uint8_t, 4> bottom, top;
};
ImageBackground image_background(const RenderOptions& options);

// The voxels, as an image frames them.
Subject subject_of(const PackedGrid& grid);

// A section's plane in space of the grid, positive in the part that is cut away, with a largest
// coefficient of about 1.
glm::dvec4 section_in_grid(const std::array<double, 4>& plane, const GridSpec& spec);

// Rays along each side of a pixel, before a device's limits: the requested number, or one that
// suits the image's size.
int wanted_samples(const RenderOptions& options, const RenderQuality& quality);

// Camera, light and dimensions of an image. samples: rays along each side of a pixel. The tables of
// `grid` are not read. Errors: invalid-option if the matrix cannot be inverted.
Result<shared::RaymarchParams> raymarch_params(const PackedGrid& grid, const RenderOptions& options,
                                               int samples);

}  // namespace voxeld
