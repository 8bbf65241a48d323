// The ray march pass on the CPU.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include <glm/vec4.hpp>

#include "server/render/cpu/kernels/march_kernel.h"
#include "server/render/packed_grid.h"
#include "server/render/raymarch_params.h"
#include "server/render/render.h"
#include "shaders/shared/raymarch.h"

namespace voxeld {

// The data that GL would bind: an image's parameters and a grid's tables. Both must outlive this.
struct RaymarchBindings {
  const shared::RaymarchParams& params;
  const PackedGrid& grid;
  RaymarchVariant variant;  // not used for hits
  const MarchKernel& kernel;
};

// The steps of the pass's main(), for pixels x, y (y from the bottom) of a part of an image. Pixels
// that are near each other share work. Not thread-safe.
class RaymarchPixels {
 public:
  explicit RaymarchPixels(const RaymarchBindings& bindings);
  ~RaymarchPixels();

  // The sums of the samples of pixels x to x + count - 1: linear light RGB, and the number of those
  // that meet the grid.
  void seen(int x, int y, int count, glm::vec4* sums);
  // How dark the floor is there, 0..1.
  float ground(int x, int y);
  // The colour as RGBA, sRGB with straight alpha. ground: of ground(), 0 without a floor.
  std::array<uint8_t, 4> color(int x, int y, const glm::vec4& seen, float ground) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

Hit raymarch_hit(const RaymarchBindings& bindings, int x, int y);

}  // namespace voxeld
