// The id with the largest sum of weights in each voxel, for channels of ids such as materials
// (defined in README.md). Ids are added in ascending order, so the smallest id wins a tie.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "server/voxel/triangles/snap.h"

namespace voxeld {

// A channel and the id, or 0, that it gives each part of the scene. Channel colour: the ids decide
// whose colour a voxel gets.
struct IdChannel {
  Channel channel = Channel::kMaterial;
  std::vector<uint16_t> part_ids;
  // There are too many ids for one device pass each, so the CPU finishes the device's tiles.
  bool is_wide = false;

  uint16_t id_of(const SnappedMesh& mesh, uint32_t triangle) const {
    return part_ids[mesh.triangles[triangle].part];
  }
};

// The ids of `triangles`, ascending, without duplicates.
inline std::vector<uint16_t> distinct_ids(const IdChannel& channel, const SnappedMesh& mesh,
                                          std::span<const uint32_t> triangles) {
  std::vector<uint16_t> ids;
  for (const uint32_t triangle : triangles) {
    const uint16_t id = channel.id_of(mesh, triangle);
    if (ids.empty() || ids.back() != id) ids.push_back(id);
  }
  std::ranges::sort(ids);
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

class IdFold {
 public:
  void begin(size_t voxels) { best_.assign(voxels, 0); }

  // Writes `ids` where this id has the largest sum so far. weight(voxel): the sum over the
  // triangles with this id.
  template <typename Weight>
  void add(uint16_t id, const Weight& weight, std::span<uint16_t> ids) {
    for (size_t voxel = 0; voxel < best_.size(); ++voxel) {
      const uint64_t sum = weight(voxel);
      if (sum <= best_[voxel]) continue;
      best_[voxel] = sum;
      ids[voxel] = id;
    }
  }

 private:
  std::vector<uint64_t> best_;
};

}  // namespace voxeld
