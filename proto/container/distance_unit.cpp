#include "proto/container/distance_unit.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "proto/options/values.h"
#include "proto/options/words.h"

namespace voxeld {

bool has_world_distances(const nlohmann::json& meta) {
  const auto options = meta.find("options");
  if (options == meta.end() || !options->is_object()) return false;
  const auto unit = options->find("distance");
  return unit != options->end() && *unit == option_values::word_of<DistanceUnit>(
                                                DistanceUnit::kWorld, option_words::kDistance);
}

double distance_unit(bool is_world, const std::array<double, 3>& voxel_size) {
  return is_world ? std::ranges::min(voxel_size) : 1.0;
}

double distance_unit(const GridHeader& header) {
  if (!header.channels.distance) return 1.0;
  const auto meta = nlohmann::json::parse(header.meta_json, nullptr, /*allow_exceptions=*/false);
  return distance_unit(has_world_distances(meta), header.voxel_size);
}

}  // namespace voxeld
