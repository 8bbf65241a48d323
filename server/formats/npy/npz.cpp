// Writes NumPy's .npz: a zip of deflated .npy members.
#include <array>
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

Status add_array(ZipWriter& zip, std::string_view name, std::span<const uint8_t> header,
                 const ArrayPieces& array) {
  VOXELD_TRY(zip.begin(std::string(name) + ".npy"));
  VOXELD_TRY(zip.add(header));
  return append_pieces(zip, array);
}

Status add_dense(ZipWriter& zip, const Grid& grid, const OutputOptions& options) {
  const auto add = [&](std::string_view name, std::optional<Channel> channel) {
    const DenseArray array(grid, channel, options);
    return add_array(zip, name, array.header(), array);
  };
  VOXELD_TRY(add("occupancy", std::nullopt));
  for (const ChannelInfo& info : kChannels) {
    if (grid.channels.has(info.channel)) VOXELD_TRY(add(info.name, info.channel));
  }
  return {};
}

Status add_sparse(ZipWriter& zip, const Grid& grid, const OutputOptions& options) {
  const VoxelPieces voxels(grid);
  const uint64_t count = voxels.voxel_count();
  VOXELD_TRY(check_sparse(count, options.format));
  VOXELD_TRY(add_array(zip, "coords", coords_header(count, false),
                       SparseArray::coords(voxels, std::nullopt)));
  for (const ChannelInfo& info : kChannels) {
    if (!grid.channels.has(info.channel)) continue;
    VOXELD_TRY(add_array(zip, info.name, rows_header(count, info.channel, options),
                         SparseArray(voxels, info.channel, options)));
  }
  return {};
}

}  // namespace

Status append_pieces(ZipWriter& zip, const ArrayPieces& array) {
  return zip.add_pieces(
      array.piece_count(), [&](size_t i) { return array.piece_bytes(i); },
      [&](size_t i, std::span<uint8_t> bytes) { array.fill(i, bytes); }, array.repeats());
}

Status add_placement(ZipWriter& zip, const Grid& grid, const OutputOptions& options) {
  const auto add = [&](std::string_view name, const std::vector<uint8_t>& array) -> Status {
    VOXELD_TRY(zip.begin(std::string(name) + ".npy"));
    return zip.add(array);
  };
  const GridHeader header = container_header(grid);
  if (options.layout == ArrayLayout::kSparse) {
    const std::array<int64_t, 3> dims = {header.dims[0], header.dims[1], header.dims[2]};
    VOXELD_TRY(add("dims", npy_integers(dims)));
  }
  VOXELD_TRY(add("origin", npy_doubles(header.origin)));
  VOXELD_TRY(add("voxel_size", npy_doubles(header.voxel_size)));
  return add("meta", npy_text(header.meta_json));
}

Status encode_npz(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  ZipWriter zip(file);
  VOXELD_TRY(options.layout == ArrayLayout::kSparse ? add_sparse(zip, grid, options)
                                                    : add_dense(zip, grid, options));
  VOXELD_TRY(add_placement(zip, grid, options));
  return zip.finish();
}

}  // namespace voxeld
