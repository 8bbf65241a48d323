// Builds the octrees of a batch of tiles on the device, level by level, from their masks: the bytes
// of octree_from_tile() (proto/octree_codec.h), so that what is read back is what is stored.
#pragma once

#include <cstdint>
#include <vector>

#include "server/gpu/objects.h"
#include "server/gpu/pass_timer.h"
#include "server/gpu/shader_library.h"

namespace voxeld {

class BatchOctree {
 public:
  BatchOctree(const gpu::Context& context, gpu::ShaderLibrary& shaders)
      : context_(&context), shaders_(&shaders) {}

  // masks: kTileMaskBytes for each of `tiles`, 1..BATCH_SLOTS_MAX (BatchTouch::masks()).
  // has_attributes: of voxels, which then lie in no full node. The octree of each tile, empty for
  // those without voxels. After Zhou, Gong, Huang & Guo 2011, from the leaves up, with bit masks
  // instead of sorted points.
  Result<std::vector<std::vector<uint8_t>>> run(const gpu::Buffer& masks, size_t tiles,
                                                bool has_attributes, gpu::PassTimer& timer);

  // Of all buffers now.
  int64_t bytes() const;

 private:
  Status dispatch(const gpu::Buffer& masks, size_t tiles, bool has_attributes,
                  gpu::PassTimer& timer);

  const gpu::Context* context_;
  gpu::ShaderLibrary* shaders_;
  gpu::Buffer bricks_, places_, tiles_, octrees_, count_, params_;
};

}  // namespace voxeld
