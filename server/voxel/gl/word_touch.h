// Occupancy by pipeline compute on software drivers: rule touch, no attributes. Small triangles
// take pass voxelize_words; the mask is memory of this machine, so that bricks are taken out of it
// where it stands.
#pragma once

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

  // A tile: sort() some of its triangles, touch() what was sorted, as often as it takes; then
  // take_bricks() once. cell_max: tile_cell_max().
  Status sort(const SnappedMesh& mesh, const glm::ivec3& tile_coord, const glm::ivec3& cell_max,
              std::span<const uint32_t> triangles);
  // Of the last sort(): what touch() does not take, for others to set in mask().
  std::span<const uint32_t> large() const { return small_.large(); }
  size_t small_count() const { return small_.count(); }
  Status touch();
  // VOXELIZE_MASK of the tile, for others to set bits in.
  const gpu::Buffer& mask() {
    is_clear_ = false;
    return mask_;
  }
  // `more_blocks`: where others may have set bits, as TileWindow::blocks.
  Status take_bricks(uint64_t more_blocks, SparseTile& tile);

  // Of all buffers now, and at most for so many triangles at a time.
  int64_t bytes() const;
  static int64_t bytes_max(size_t triangles);

 private:
  const gpu::Context* context_;
  gpu::ShaderLibrary* shaders_;
  std::optional<WorkerPool> pool_;  // from the first job on
  SmallTriangles small_;
  MaskBricks bricks_;
  gpu::Buffer triangles_, mask_, params_;
  glm::ivec3 cell_max_{0};
  uint64_t blocks_ = 0;    // of the tile so far
  bool is_clear_ = false;  // all of the mask is 0; a job that fails may leave bits
};

}  // namespace voxeld
