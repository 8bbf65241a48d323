// Uploaded assets, and the place of one in the list of assets.
#pragma once

#include <cstdint>
#include <limits>
#include <string>

namespace voxeld {

struct Asset {
  std::string id;  // AssetId: content hash of the upload, and how it is read
  std::string tenant;
  std::string filename;  // as given; may be empty
  std::string content_type;
  int64_t bytes = 0;
  int64_t created_ms = 0;
  std::string description_json;  // object from the last inspect job; empty until inspected
  bool existed = false;          // of put: the tenant had it already
};

// A place in the list of assets, newest first, then by id and tenant; by default before all.
struct AssetCursor {
  int64_t created_ms = std::numeric_limits<int64_t>::max();
  std::string id, tenant;
};

}  // namespace voxeld
