// What every ray march needs to know of a picture, whatever runs it.
#pragma once

#include "proto/options.h"
#include "proto/result.h"
#include "server/render/packed_grid.h"
#include "server/render/render.h"
#include "shaders/shared/raymarch.h"

namespace voxeld {

// More steps than any ray through the grid can take.
int ray_steps_max(const PackedGrid& grid);

// What the ray march leaves out where a picture does not need it; shaders/raymarch.frag.
struct RaymarchVariant {
  bool attributes = false;  // voxels have colours or normals
  bool smooth = false;      // normals are estimated
  bool light = false;       // there is ambient occlusion or a shadow
};
RaymarchVariant raymarch_variant(const PackedGrid& grid, const RenderOptions& options);

// Rays along each side of a pixel, before limits of a device: what was asked for, or what suits a
// picture of this size.
int wanted_samples(const RenderOptions& options, const RenderQuality& quality);

// Camera, light and dimensions of a picture. `samples`: along each side of a pixel. The tables of
// `grid` are not read. Errors: invalid-option for a matrix that cannot be inverted.
Result<shared::RaymarchParams> raymarch_params(const PackedGrid& grid, const RenderOptions& options,
                                               int samples);

}  // namespace voxeld
