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
#include "server/voxel/tile_window.h"
#include "shaders/shared/voxelize.h"

namespace voxeld {

inline constexpr size_t kTileMaskBytes =
    size_t{limits::kTileSide} * limits::kTileSide * limits::kTileSide / 8;
inline constexpr size_t kTileMaskWords = kTileMaskBytes / 4;
// A block of 64^3 cells is a contiguous part of the mask.
inline constexpr size_t kBlockMaskWords = kTileMaskWords / 64;

// Triangles of one window: 19 MB of vertices and 52 MB of attributes stay far below the 128 MiB
// that storage buffers have on software drivers, and one window serves most tiles.
inline constexpr size_t kWindowTrianglesMax = size_t{1} << 19;

// Calls visit(first_word, word_count) for the maximal runs of set blocks.
template <typename Visit>
void for_each_block_run(uint64_t blocks, const Visit& visit) {
  for (size_t block = 0; block < 64;) {
    if ((blocks >> block & 1) == 0) {
      ++block;
      continue;
    }
    size_t end = block;
    while (end < 64 && (blocks >> end & 1) != 0) ++end;
    visit(block * kBlockMaskWords, (end - block) * kBlockMaskWords);
    block = end;
  }
}

// One thread: the context's.
class TileDevice {
 public:
  explicit TileDevice(const gpu::Context& context) : context_(&context) {}

  Status begin_tile(const glm::ivec3& cell_max);
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
};

}  // namespace voxeld
