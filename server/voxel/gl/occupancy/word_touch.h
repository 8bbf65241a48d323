// Occupancy by pipeline compute on software drivers, for rule touch without attributes. Small
// triangles run in pass voxelize_words. The mask is in host memory, so bricks are taken directly
// out of it.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "server/gpu/objects.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/gl/occupancy/mask_bricks.h"
#include "server/voxel/gl/occupancy/small_triangles.h"
#include "server/voxel/triangles/bin.h"

namespace voxeld {

// Runs the pass. It keeps programs and memory between jobs. Only the context's thread may use it.
class WordTouch {
 public:
  WordTouch(const gpu::Context& context, gpu::ShaderLibrary& shaders)
      : context_(&context), shaders_(&shaders) {}

  // Called before the tiles of a job.
  Status begin_job();

  static constexpr size_t kBatchTiles = SmallTriangles::kSlotsMax;

  // Processes a batch of at most kBatchTiles tiles. sort() prepares some of their triangles and
  // touch() runs them, as often as needed; then take_bricks() once. A batch is faster than single
  // tiles, because each run makes all threads wait for each other.
  Status sort(const SnappedMesh& mesh, std::span<const TilePart> parts);
  // The triangles of a slot that the last sort() left to the caller, who sets their bits in the
  // mask.
  std::span<const uint32_t> large(size_t slot) const { return small_.large(slot); }
  size_t small_count() const { return small_.count(); }
  Status touch();
  // VOXELIZE_MASK of the slots, kTileMaskBytes each. The caller may set bits in them.
  const gpu::Buffer& masks() {
    is_clear_ = false;
    return masks_;
  }
  // Moves the bricks of slot i into tiles[i]. more_blocks: blocks in which the caller may have set
  // bits; see TileWindow::blocks.
  Status take_bricks(std::span<const uint64_t> more_blocks, std::span<SparseTile> tiles);

  // Bytes of all buffers now, and their maximum for `triangles` triangles at a time.
  int64_t bytes() const;
  static int64_t bytes_max(size_t triangles);

 private:
  const gpu::Context* context_;
  gpu::ShaderLibrary* shaders_;
  ThreadTeam team_{voxel_threads()};
  SmallTriangles small_;
  MaskBricks bricks_;
  gpu::Buffer triangles_, masks_, params_;
  std::array<uint64_t, kBatchTiles> blocks_{};  // blocks of the slots so far
  bool is_clear_ = false;                       // all masks are 0; a job that fails may leave bits
};

}  // namespace voxeld
