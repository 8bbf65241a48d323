// What the frames of one scene have in common, from one call of Voxelizer::voxelize() to the next:
// vertices move, everything else stays.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "server/grid/grid_spec.h"
#include "server/voxel/attribute_records.h"
#include "server/voxel/estimate.h"

namespace voxeld {

// For calls with one scene, of which positions and normals alone change, and the same options. A
// frame's grid has the bytes that it would have without it. One thread.
class SharedFrames {
 public:
  // Where all grids lie, in place of what the request's placement gives for each.
  explicit SharedFrames(const GridSpec& spec);

  const GridSpec& spec() const { return spec_; }
  // Looked up once: whether anything is transparent takes a look at all texels.
  const WantedChannels& channels(const Scene& scene, const VoxelizeOptions& options);

  // Adds the levels that a frame samples to those of the frames before it, in both places.
  void unite_levels(std::vector<ImageLevels>& of_frame);
  // Names the scene's images at these levels, among all that a process makes: pipelines keep what
  // they made of them as long as it stays the same. Never 0.
  uint64_t textures_key() const { return textures_key_; }

 private:
  GridSpec spec_;
  std::optional<WantedChannels> channels_;
  std::vector<ImageLevels> levels_;
  uint64_t textures_key_;
};

}  // namespace voxeld
