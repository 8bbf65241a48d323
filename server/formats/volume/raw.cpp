// Writes a zip of an array as plain bytes and of a header that says how to read them:
//
//   grid.nhdr  a detached header of NRRD (nrrd_header.h), which names grid.raw
//   grid.raw   the samples: little-endian, x fastest, then y, then z; components before x
//
// Unpacked, grid.nhdr opens in the readers of NRRD, and grid.raw in those that ask for the sides
// and the type.
#include "server/formats/formats.h"
#include "server/formats/output_file.h"
#include "server/formats/volume/nrrd_header.h"
#include "server/formats/volume/volume_array.h"
#include "server/formats/volume/volume_facts.h"
#include "server/formats/zip/zip_writer.h"

namespace voxeld {

Status encode_raw(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  using namespace volume;
  const std::optional<Channel> channel = options.channel;
  const ArrayType type = array_type(channel, options);
  ZipWriter zip(file);
  VOXELD_TRY(zip.begin("grid.nhdr"));
  VOXELD_TRY(zip.add(
      text_bytes(nrrd_header(grid, channel, type, {.encoding = "raw", .file = "grid.raw"}))));
  VOXELD_TRY(zip.begin("grid.raw"));
  VOXELD_TRY(append_pieces(zip, VolumeArray(grid, channel, options)));
  return zip.finish();
}

}  // namespace voxeld
