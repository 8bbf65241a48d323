// The slice map of Eisemann & Decoret 2008, "Single-pass GPU solid voxelization for real-time
// applications". Pixels are the columns of a tile; the 256 bits of a pixel are the column's cells.
// A fragment writes the mask of all cells above its triangle's crossing, and the framebuffer's XOR
// combines the masks to parity.
//
// It differs from the paper in three ways. First, candidates are conservative, and the fragment
// shader decides column and depth in exact integers, so the rasterizer's rounding changes nothing.
// Second, masks are the cells above, not below. For closed meshes that is the same; for others it
// is what "crossings below" means. Third, two targets of 128 bits are a tile, and solid_scan.comp
// carries on from tile to tile.
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
  // parameters must be bound.
  Status draw(gpu::ShaderLibrary& shaders, size_t triangles);
  // Binds SOLID_SLICES_LOW and SOLID_SLICES_HIGH for texelFetch.
  void bind_textures() const;

 private:
  const gpu::Context* context_ = nullptr;
  uint32_t framebuffer_ = 0, low_ = 0, high_ = 0;
  gpu::VertexArray vertex_array_;
};

}  // namespace voxeld
