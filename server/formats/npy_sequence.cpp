// Writes arrays with a frame axis. The samples of a frame equal those of its grid alone. Frames
// follow one another in memory: (f, z, y, x, …), or, in Fortran order, (x, y, z, …, f).
#include <optional>
#include <string>

#include "server/formats/formats.h"
#include "server/formats/npy_array.h"
#include "server/formats/sequence_file.h"
#include "server/formats/zip_writer.h"

namespace voxeld {
namespace {

// Appends a .npy file to `out` (SequenceFile, ZipWriter), frame by frame.
template <typename Append>
Status append_frames(const FrameSource& source, std::optional<Channel> channel,
                     const OutputOptions& options, Append&& append) {
  const size_t frames = source.frame_count();
  VOXELD_TRY(append(npy_frames_header(source.common().spec, frames, channel, options)));
  for (size_t i = 0; i < frames; ++i) {
    VOXELD_ASSIGN(const Grid frame, source.frame(i));
    const std::vector<uint8_t> array = npy_channel(frame, channel, options);
    VOXELD_TRY(append(std::span(array).subspan(npy_data_begin(array))));
  }
  return {};
}

}  // namespace

Status write_npy_sequence(const FrameSource& source, const OutputOptions& options,
                          const std::filesystem::path& path) {
  VOXELD_ASSIGN(SequenceFile file, SequenceFile::create(path));
  return append_frames(source, std::nullopt, options,
                       [&](std::span<const uint8_t> bytes) { return file.append(bytes); });
}

Status write_npz_sequence(const FrameSource& source, const OutputOptions& options,
                          const std::filesystem::path& path) {
  VOXELD_ASSIGN(SequenceFile file, SequenceFile::create(path));
  ZipWriter zip(file);
  const auto append = [&](std::span<const uint8_t> bytes) { return zip.add(bytes); };
  VOXELD_TRY(zip.begin("occupancy.npy"));
  VOXELD_TRY(append_frames(source, std::nullopt, options, append));
  const Grid& common = source.common();
  for (const ChannelInfo& info : kChannels) {
    if (!common.channels.has(info.channel)) continue;
    VOXELD_TRY(zip.begin(std::string(info.name) + ".npy"));
    VOXELD_TRY(append_frames(source, info.channel, options, append));
  }
  const GridHeader header = container_header(common);
  std::vector<double> times(source.frame_count());
  for (size_t i = 0; i < times.size(); ++i) times[i] = source.time_s(i);
  VOXELD_TRY(zip.begin("times.npy"));
  VOXELD_TRY(zip.add(npy_doubles(times)));
  VOXELD_TRY(zip.begin("origin.npy"));
  VOXELD_TRY(zip.add(npy_doubles(header.origin)));
  VOXELD_TRY(zip.begin("voxel_size.npy"));
  VOXELD_TRY(zip.add(npy_doubles(header.voxel_size)));
  VOXELD_TRY(zip.begin("meta.npy"));
  VOXELD_TRY(zip.add(npy_text(header.meta_json)));
  return zip.finish();
}

}  // namespace voxeld
