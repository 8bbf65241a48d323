#include "proto/grid_format.h"
#include "server/formats/formats.h"

namespace voxeld {

// Codec::kFast is the only one: see proto/grid_format.h.
Result<std::vector<uint8_t>> encode_native(const Grid& grid, const OutputOptions& /*options*/) {
  return encode_grid(container_header(grid), grid.tiles);
}

}  // namespace voxeld
