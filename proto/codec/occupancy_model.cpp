#include "proto/codec/occupancy_model.h"

namespace voxeld {

OccupancyModel::OccupancyModel() : entries_(first_entry(kModelContexts)) {
  // Initial weights: an unused entry has none. The others begin near an equal share, with more
  // weight the more often they were used.
  for (Weights& weights : weights_) {
    for (auto& of_context : weights) {
      for (size_t bucket = 1; bucket < kBuckets; ++bucket) {
        of_context[bucket] = static_cast<int32_t>(9830 + 1966 * bucket);
      }
    }
  }
}

}  // namespace voxeld
