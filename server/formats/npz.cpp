// Writes NumPy's .npz: a zip of deflated .npy members.
#include <string>

#include "server/formats/formats.h"
#include "server/formats/npy_array.h"
#include "server/formats/sequence_file.h"
#include "server/formats/zip_writer.h"

namespace voxeld {

Result<std::vector<uint8_t>> encode_npz(const Grid& grid, const OutputOptions& options) {
  SequenceFile file = SequenceFile::in_memory();
  ZipWriter zip(file);
  const auto add = [&](std::string_view name, const std::vector<uint8_t>& array) -> Status {
    VOXELD_TRY(zip.begin(std::string(name) + ".npy"));
    return zip.add(array);
  };
  VOXELD_TRY(add("occupancy", npy_channel(grid, std::nullopt, options)));
  for (const ChannelInfo& info : kChannels) {
    if (!grid.channels.has(info.channel)) continue;
    VOXELD_TRY(add(info.name, npy_channel(grid, info.channel, options)));
  }
  const GridHeader header = container_header(grid);
  VOXELD_TRY(add("origin", npy_doubles(header.origin)));
  VOXELD_TRY(add("voxel_size", npy_doubles(header.voxel_size)));
  VOXELD_TRY(add("meta", npy_text(header.meta_json)));
  VOXELD_TRY(zip.finish());
  return file.take_bytes();
}

}  // namespace voxeld
