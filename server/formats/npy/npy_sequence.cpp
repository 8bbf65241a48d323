// Writes arrays of all frames. The samples of a frame equal those of its grid alone, and frames
// follow one another in memory. Dense arrays have a frame axis: (f, z, y, x, …), or, in Fortran
// order, (x, y, z, …, f). Sparse ones have the rows of all frames, and the frame's number in the
// first column of coords.
#include <optional>
#include <string>
#include <string_view>

#include "server/formats/formats.h"
#include "server/formats/npy/dense_array.h"
#include "server/formats/npy/npy_array.h"
#include "server/formats/npy/sparse_array.h"
#include "server/formats/output_file.h"
#include "server/formats/zip/zip_writer.h"

namespace voxeld {
namespace {

Status append(OutputFile& file, std::span<const uint8_t> bytes) {
  return file.append(bytes);
}
Status append(ZipWriter& zip, std::span<const uint8_t> bytes) {
  return zip.add(bytes);
}

// Appends the .npy file of a channel (nullopt: occupancy).
template <typename Output>
Status append_dense(Output& out, const FrameSource& source, std::optional<Channel> channel,
                    const OutputOptions& options) {
  const size_t frames = source.frame_count();
  VOXELD_TRY(append(out, npy_frames_header(source.common().spec, frames, channel, options)));
  for (size_t i = 0; i < frames; ++i) {
    VOXELD_ASSIGN(const Grid frame, source.frame(i));
    VOXELD_TRY(append_pieces(out, DenseArray(frame, channel, options)));
  }
  return {};
}

// The same in layout sparse; nullopt: coords. `voxels`: of all frames.
template <typename Output>
Status append_sparse(Output& out, const FrameSource& source, std::optional<Channel> channel,
                     const OutputOptions& options, uint64_t voxels) {
  VOXELD_TRY(
      append(out, channel ? rows_header(voxels, *channel, options) : coords_header(voxels, true)));
  for (size_t i = 0; i < source.frame_count(); ++i) {
    VOXELD_ASSIGN(const Grid frame, source.frame(i));
    const VoxelPieces pieces(frame);
    VOXELD_TRY(append_pieces(out, channel ? SparseArray(pieces, *channel, options)
                                          : SparseArray::coords(pieces, static_cast<int32_t>(i))));
  }
  return {};
}

// Frames are decoded for their number of voxels: a header comes before what it counts.
Result<uint64_t> count_voxels(const FrameSource& source, Format format) {
  uint64_t voxels = 0;
  for (size_t i = 0; i < source.frame_count(); ++i) {
    VOXELD_ASSIGN(const Grid frame, source.frame(i));
    voxels += frame.voxel_count();
    VOXELD_TRY(check_sparse(voxels, format));
  }
  return voxels;
}

}  // namespace

Status write_npy_sequence(const FrameSource& source, const OutputOptions& options,
                          const std::filesystem::path& path) {
  VOXELD_ASSIGN(OutputFile file, OutputFile::create(path));
  if (options.layout == ArrayLayout::kDense) {
    return append_dense(file, source, std::nullopt, options);
  }
  VOXELD_ASSIGN(const uint64_t voxels, count_voxels(source, options.format));
  return append_sparse(file, source, std::nullopt, options, voxels);
}

Status write_npz_sequence(const FrameSource& source, const OutputOptions& options,
                          const std::filesystem::path& path) {
  VOXELD_ASSIGN(OutputFile file, OutputFile::create(path));
  const bool is_sparse = options.layout == ArrayLayout::kSparse;
  uint64_t voxels = 0;
  if (is_sparse) {
    VOXELD_ASSIGN(voxels, count_voxels(source, options.format));
  }
  ZipWriter zip(file);
  const auto add = [&](std::string_view name, std::optional<Channel> channel) -> Status {
    VOXELD_TRY(zip.begin(std::string(name) + ".npy"));
    return is_sparse ? append_sparse(zip, source, channel, options, voxels)
                     : append_dense(zip, source, channel, options);
  };
  VOXELD_TRY(add(is_sparse ? "coords" : "occupancy", std::nullopt));
  for (const ChannelInfo& info : kChannels) {
    if (source.common().channels.has(info.channel)) VOXELD_TRY(add(info.name, info.channel));
  }
  std::vector<double> times(source.frame_count());
  for (size_t i = 0; i < times.size(); ++i) times[i] = source.time_s(i);
  VOXELD_TRY(zip.begin("times.npy"));
  VOXELD_TRY(zip.add(npy_doubles(times)));
  VOXELD_TRY(add_placement(zip, source.common(), options));
  return zip.finish();
}

}  // namespace voxeld
