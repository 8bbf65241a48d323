#include "proto/container/grid_format.h"
#include "server/formats/formats.h"

namespace voxeld {

Result<std::vector<uint8_t>> encode_native(const Grid& grid, const OutputOptions& options) {
  GridHeader header = container_header(grid);
  header.codecs = StreamCodecs::all(options.codec);
  return encode_grid(header, grid.tiles);
}

}  // namespace voxeld
