// Construction of the octrees of a batch of tiles on the device, level by level, from their masks.
// The bytes are those of octree_from_tile() (proto/codec/octree_codec.h), so they are stored as
// they are read back.
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

  // The octree of each tile, empty for tiles without voxels. It is built from the leaves up after
  // Zhou, Gong, Huang & Guo 2011, with bit masks instead of sorted points. masks: kTileMaskBytes
  // for each of `tiles`, 1..BATCH_SLOTS_MAX (BatchTouch::masks()). has_attributes: the voxels have
  // attributes and are therefore in no full node.
  Result<std::vector<std::vector<uint8_t>>> run(const gpu::Buffer& masks, size_t tiles,
                                                bool has_attributes, gpu::PassTimer& timer);

 private:
  Status dispatch(const gpu::Buffer& masks, size_t tiles, bool has_attributes,
                  gpu::PassTimer& timer);

  const gpu::Context* context_;
  gpu::ShaderLibrary* shaders_;
  gpu::Buffer bricks_, places_, tiles_, octrees_, count_, params_;
};

}  // namespace voxeld
