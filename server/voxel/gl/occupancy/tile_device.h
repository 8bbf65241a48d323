// The buffers of the current tile and window, which both passes over a tile share, and the way that
// either pipeline runs a pass over a window.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "proto/result.h"
#include "server/gpu/objects.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/gl/occupancy/dispatch_pace.h"
#include "server/voxel/tiles/tile_mask.h"
#include "server/voxel/triangles/tile_window.h"
#include "shaders/shared/voxelize.h"

namespace voxeld {

// Holds the buffers. Only the context's thread may use it.
class TileDevice {
 public:
  TileDevice(const gpu::Context& context, const DispatchPace& pace)
      : context_(&context), pace_(&pace) {}

  Status begin_tile(const glm::ivec3& cell_max);
  // Uses `masks` at `offset_bytes` as the tile's mask until the next begin_tile(). The owner of
  // `masks` must clear it.
  void use_mask(const gpu::Buffer& masks, size_t offset_bytes);
  // Uploads vertices, and work items if `with_items`.
  Status upload_window(const TileWindow& window, bool with_items);
  // Zeroes the mask in those `blocks` that were not yet cleared in this tile.
  Status clear_mask(uint64_t blocks);
  // Reads the words of `blocks`; other words of `out` keep their values. out: kTileMaskWords.
  void read_mask(uint64_t blocks, std::span<uint32_t> out) const;

  // Bind triangles, items, mask and parameters, and run. They set cell_max and the range
  // (item_first and its like) in `params`. Work that would take too long is several dispatches.
  // Errors: cancelled, between two of them.
  Status run_items(const gpu::Program& program, size_t first, size_t count,
                   shared::VoxelizeParams params);
  Status run_triangles(const gpu::Program& program, size_t first, size_t count,
                       shared::VoxelizeParams params);

  const gpu::Context& context() const { return *context_; }
  // Bytes of all buffers now.
  int64_t bytes() const;

 private:
  void bind(const shared::VoxelizeParams& params);
  void draw(const gpu::Program& program, size_t triangles) const;

  const gpu::Context* context_;
  const DispatchPace* pace_;
  gpu::Buffer triangles_, items_, mask_, params_;
  gpu::Framebuffer framebuffer_;
  gpu::VertexArray vertex_array_;
  shared::ivec4 cell_max_;
  uint64_t cleared_blocks_ = 0;
  const gpu::Buffer* other_mask_ = nullptr;  // set by use_mask()
  size_t other_offset_ = 0;
};

}  // namespace voxeld
