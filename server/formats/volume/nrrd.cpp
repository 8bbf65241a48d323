// Writes NRRD: the header, an empty line and one array in gzip, x fastest, components before x.
// nrrd_header.h has the fields and the specification.
#include "server/formats/formats.h"
#include "server/formats/output_file.h"
#include "server/formats/volume/nrrd_header.h"
#include "server/formats/volume/volume_array.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld {

Status encode_nrrd(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  using namespace volume;
  const std::optional<Channel> channel = options.channel;
  const ArrayType type = array_type(channel, options);
  VOXELD_TRY(file.append(text_bytes(nrrd_header(grid, channel, type, {.encoding = "gzip"}))));
  DeflateStream stream(file, DeflateStream::Frame::kGzip);
  VOXELD_TRY(stream.begin());
  VOXELD_TRY(append_pieces(stream, VolumeArray(grid, channel, options)));
  return stream.finish();
}

}  // namespace voxeld
