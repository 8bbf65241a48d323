// Which id has the largest sum of weights in a voxel: channels of ids, e.g. of materials. README.md
// defines it. Ids come in ascending order, each with its sums, so the first of equal ones stays.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/sparse_tile.h"
#include "server/voxel/snap.h"

namespace voxeld {

// A channel and what it says of each part of the scene: an id, or 0. Channel colour: where the
// colour is that of the id with the largest sum.
struct IdChannel {
  Channel channel = Channel::kMaterial;
  std::vector<uint16_t> part_ids;
  // There are more than a device should make a pass for each: the CPU finishes what it made.
  bool is_wide = false;

  uint16_t id_of(const SnappedMesh& mesh, uint32_t triangle) const {
    return part_ids[mesh.triangles[triangle].part];
  }
};

// The ids of triangles, ascending, each once.
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

// The tile's samples of a channel of ids.
inline std::vector<uint16_t>& id_samples(SparseTile& tile, Channel channel) {
  return channel == Channel::kLabel ? tile.label : tile.material;
}

class IdFold {
 public:
  void begin(size_t voxels) { best_.assign(voxels, 0); }

  // weight(voxel): the sum over the triangles with this id. Writes `ids` where it is the largest.
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
