// The slice map of Eisemann & Decoret 2008, "Single-pass GPU solid voxelization for real-time
// applications": pixels are the columns of a tile, and the 256 bits of a pixel its cells. A
// fragment writes the mask of all cells above its triangle's crossing, and the logical operation
// XOR of the framebuffer joins them to parity. What differs: candidates are conservative and the
// fragment shader decides about column and depth in exact integers, so that the rasterizer's
// rounding changes nothing; masks are cells above, not below, which is the same for closed meshes
// and is what "crossings below" means for others; two targets of 128 bits are a tile, and
// solid_scan.comp goes on from tile to tile.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/gpu/objects.h"
#include "server/gpu/shader_library.h"

namespace voxeld {

class SliceMap {
 public:
  static constexpr size_t kBytes = size_t{256} * 256 * 32;

  SliceMap() = default;
  static Result<SliceMap> create(const gpu::Context& context);
  ~SliceMap();
  SliceMap(SliceMap&& other) noexcept;
  SliceMap& operator=(SliceMap&& other) noexcept;

  size_t size_bytes() const { return framebuffer_ == 0 ? 0 : kBytes; }
  void clear();
  // Flips the cells above the crossings of the first `triangles` of SOLID_TRIANGLES. Corners and
  // parameters are bound.
  Status draw(gpu::ShaderLibrary& shaders, size_t triangles);
  // For texelFetch: SOLID_SLICES_LOW and SOLID_SLICES_HIGH.
  void bind_textures() const;

 private:
  const gpu::Context* context_ = nullptr;
  uint32_t framebuffer_ = 0, low_ = 0, high_ = 0;
  gpu::VertexArray vertex_array_;
};

}  // namespace voxeld
