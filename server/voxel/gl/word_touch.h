// Occupancy by pipeline compute on software drivers: rule touch, no attributes. Small triangles
// take pass voxelize_words; the mask is memory of this machine, so that bricks are taken out of it
// where it stands.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "server/gpu/objects.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/bin.h"
#include "server/voxel/gl/mask_bricks.h"
#include "server/voxel/gl/small_triangles.h"

namespace voxeld {

// Keeps programs and memory from job to job. One thread: the context's.
class WordTouch {
 public:
  WordTouch(const gpu::Context& context, gpu::ShaderLibrary& shaders)
      : context_(&context), shaders_(&shaders) {}

  // Before the tiles of a job.
  Status begin_job();

  static constexpr size_t kBatchTiles = SmallTriangles::kSlotsMax;

  // A batch of at most kBatchTiles tiles: sort() some of their triangles, touch() what was sorted,
  // as often as it takes; then take_bricks() once. One tile after the other would be as many waits
  // of all threads for each other.
  Status sort(const SnappedMesh& mesh, std::span<const TilePart> parts);
  // Of the last sort(): what touch() does not take of a slot, for others to set in its mask.
  std::span<const uint32_t> large(size_t slot) const { return small_.large(slot); }
  size_t small_count() const { return small_.count(); }
  Status touch();
  // VOXELIZE_MASK of the slots, kTileMaskBytes each, for others to set bits in.
  const gpu::Buffer& masks() {
    is_clear_ = false;
    return masks_;
  }
  // Of slot i into tiles[i]. `more_blocks`: where others may have set bits, as TileWindow::blocks.
  Status take_bricks(std::span<const uint64_t> more_blocks, std::span<SparseTile> tiles);

  // Of all buffers now, and at most for so many triangles at a time.
  int64_t bytes() const;
  static int64_t bytes_max(size_t triangles);

 private:
  const gpu::Context* context_;
  gpu::ShaderLibrary* shaders_;
  std::optional<WorkerPool> pool_;  // from the first job on
  SmallTriangles small_;
  MaskBricks bricks_;
  gpu::Buffer triangles_, masks_, params_;
  std::array<uint64_t, kBatchTiles> blocks_{};  // of the slots so far
  bool is_clear_ = false;                       // all masks are 0; a job that fails may leave bits
};

}  // namespace voxeld
