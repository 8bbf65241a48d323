#include "proto/occupancy_model.h"

namespace voxeld {

OccupancyModel::OccupancyModel() : entries_(first_entry(kModelContexts)) {
  // An entry that was never used says nothing; the others start near an equal share, more the more
  // they have seen.
  for (Weights& weights : weights_) {
    for (auto& of_context : weights) {
      for (size_t bucket = 1; bucket < kBuckets; ++bucket) {
        of_context[bucket] = static_cast<int32_t>(9830 + 1966 * bucket);
      }
    }
  }
}

}  // namespace voxeld
