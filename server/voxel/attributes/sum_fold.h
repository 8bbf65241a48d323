// The attribute sums of the id with the largest sum of weights in a voxel: color=dominant, defined
// in README.md. Ids are added in ascending order, as for IdFold.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/voxel/attributes/resolve.h"

namespace voxeld {

class SumFold {
 public:
  SumFold(size_t voxels, const AttributeChannels& channels)
      : stride_(channels.count()), best_(voxels * stride_) {}

  // sum(i): sums of the triangles with this id, channels.count() per voxel, the weight first.
  template <typename Sum>
  void add(const Sum& sum) {
    for (size_t first = 0; first < best_.size(); first += stride_) {
      if (sum(first) <= best_[first]) continue;
      for (size_t i = first; i < first + stride_; ++i) best_[i] = sum(i);
    }
  }
  std::span<const uint64_t> sums() const { return best_; }

 private:
  size_t stride_;
  std::vector<uint64_t> best_;
};

// The part of `options` that the sums of the dominant id resolve: colour alone.
inline ResolveOptions dominant_part(ResolveOptions options) {
  options.write = {.color = options.write.color};
  return options;
}

}  // namespace voxeld
