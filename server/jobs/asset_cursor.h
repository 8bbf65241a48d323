// The place of an asset in the list of assets: newest first, then by id and tenant.
#pragma once

#include <cstdint>
#include <limits>
#include <string>

namespace voxeld {

// Before all assets.
struct AssetCursor {
  int64_t created_ms = std::numeric_limits<int64_t>::max();
  std::string id, tenant;
};

}  // namespace voxeld
