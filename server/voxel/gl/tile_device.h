// What both passes over a tile share on the device: the buffers of the current tile and window, and
// how a pass is run over a window by either pipeline.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "proto/result.h"
#include "server/gpu/objects.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/tile_mask.h"
#include "server/voxel/tile_window.h"
#include "shaders/shared/voxelize.h"

namespace voxeld {

// One thread: the context's.
class TileDevice {
 public:
  explicit TileDevice(const gpu::Context& context) : context_(&context) {}

  Status begin_tile(const glm::ivec3& cell_max);
  // The tile's mask stands in `masks` at `offset_bytes`, until the next begin_tile(); who has it
  // clears it.
  void use_mask(const gpu::Buffer& masks, size_t offset_bytes);
  // Vertices, and work items where `with_items`.
  Status upload_window(const TileWindow& window, bool with_items);
  // Zeroes the mask where `blocks` are set and were not set before in this tile.
  Status clear_mask(uint64_t blocks);
  // Reads the words of `blocks`; others in `out` keep their values. out: kTileMaskWords.
  void read_mask(uint64_t blocks, std::span<uint32_t> out) const;

  // Binds triangles, items, mask and parameters. `params` fills item_first and so on.
  void run_items(const gpu::Program& program, size_t first, size_t count,
                 shared::VoxelizeParams params);
  Status run_triangles(const gpu::Program& program, size_t first, size_t count,
                       shared::VoxelizeParams params);

  const gpu::Context& context() const { return *context_; }
  // Bytes of all buffers now.
  int64_t bytes() const;

 private:
  void bind(const shared::VoxelizeParams& params);

  const gpu::Context* context_;
  gpu::Buffer triangles_, items_, mask_, params_;
  gpu::Framebuffer framebuffer_;
  gpu::VertexArray vertex_array_;
  shared::ivec4 cell_max_;
  uint64_t cleared_blocks_ = 0;
  const gpu::Buffer* other_mask_ = nullptr;  // of use_mask()
  size_t other_offset_ = 0;
};

}  // namespace voxeld
