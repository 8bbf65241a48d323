#include "proto/container/grid_format.h"
#include "server/formats/formats.h"
#include "server/formats/output_file.h"

namespace voxeld {

Status encode_native(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  GridHeader header = container_header(grid);
  header.codecs = StreamCodecs::all(options.codec);
  VOXELD_ASSIGN(const std::vector<uint8_t> bytes, encode_grid(header, grid.tiles));
  return file.append(bytes);
}

}  // namespace voxeld
