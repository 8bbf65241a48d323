// The pass that finds the occupied cells of a tile.
#pragma once

#include "proto/options/options.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/estimates/pipeline.h"
#include "server/voxel/gl/occupancy/tile_device.h"

namespace voxeld {

// The defines of a compute program for a class of triangles.
gpu::Defines touch_class_defines(TouchClass touch_class);
// The defines of a compute program for a rule.
gpu::Defines touch_rule_defines(Rule rule);

class TouchPass {
 public:
  // has_int64: shaders use 64-bit integers, else two 32-bit words.
  TouchPass(TileDevice& device, gpu::ShaderLibrary& shaders, bool has_int64)
      : device_(&device), shaders_(&shaders), has_int64_(has_int64) {}

  // Sets the bits of the cells that the window's triangles occupy by `rule`; none sets nothing. The
  // window must be uploaded and its blocks cleared.
  Status run(const TileWindow& window, Pipeline pipeline, Rule rule);

 private:
  TileDevice* device_;
  gpu::ShaderLibrary* shaders_;
  bool has_int64_;
};

}  // namespace voxeld
