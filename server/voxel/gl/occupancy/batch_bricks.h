// Compaction of the masks of a batch of tiles on the device, so that only occupied bricks are read
// back.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "server/gpu/objects.h"
#include "server/gpu/pass_timer.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/triangles/bin.h"

namespace voxeld {

class BatchBricks {
 public:
  BatchBricks(const gpu::Context& context, gpu::ShaderLibrary& shaders)
      : context_(&context), shaders_(&shaders) {}

  // Returns one tile per bin; tiles without voxels are empty. Bricks are in ascending order, as in
  // compact_mask(). masks: one tile's per bin; counts: BatchTouch::counts().
  Result<std::vector<SparseTile>> run(const gpu::Buffer& masks, const gpu::Buffer& counts,
                                      std::span<const TileBin> bins, gpu::PassTimer& timer);

  // Bytes of all buffers now.
  int64_t bytes() const;
  // An upper bound of bytes() for batches of `tiles`.
  static int64_t bytes_max(size_t tiles);

 private:
  Status gather(size_t bricks, int64_t groups, gpu::PassTimer& timer);

  const gpu::Context* context_;
  gpu::ShaderLibrary* shaders_;
  gpu::Buffer bits_, ranks_, tiles_, mortons_, bricks_, params_;
  size_t capacity_ = 0;
};

}  // namespace voxeld
