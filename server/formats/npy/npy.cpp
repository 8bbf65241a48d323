#include <mutex>
#include <optional>
#include <string>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/npy/dense_array.h"
#include "server/formats/npy/npy_array.h"
#include "server/formats/npy/sparse_array.h"
#include "server/formats/output_file.h"

namespace voxeld {
namespace {

// NumPy's type of samples that are written as they are stored.
template <typename Sample>
constexpr std::string_view kStoredDescr;
template <>
constexpr std::string_view kStoredDescr<uint8_t> = "|u1";
template <>
constexpr std::string_view kStoredDescr<int8_t> = "|i1";
template <>
constexpr std::string_view kStoredDescr<uint16_t> = "<u2";
template <>
constexpr std::string_view kStoredDescr<int16_t> = "<i2";

template <typename Value>
std::vector<uint8_t> npy_values(std::string_view descr, std::span<const Value> values) {
  const int64_t shape[] = {static_cast<int64_t>(values.size())};
  std::vector<uint8_t> bytes = npy_header(descr, false, shape);
  const auto* data = reinterpret_cast<const uint8_t*>(values.data());
  bytes.insert(bytes.end(), data, data + values.size_bytes());
  return bytes;
}

}  // namespace

NpyType npy_type(std::optional<Channel> channel, const OutputOptions& options) {
  const size_t components = channel ? channel_info(*channel).components : 1;
  const bool is_id = channel && channel_info(*channel).is_id();
  const bool is_distance = channel && channel_info(*channel).kind == ChannelKind::kDistance;
  if (is_distance || (!is_id && options.dtype == DType::kFloat32)) return {"<f4", 4, components};
  if (!channel) return {options.dtype == DType::kBool ? "|b1" : "|u1", 1, 1};
  NpyType type{"", channel_info(*channel).sample_bytes, components};
  with_channel_member(
      *channel, [&](auto, auto member) { type.descr = kStoredDescr<SampleOf<decltype(member)>>; });
  return type;
}

std::vector<int64_t> npy_shape(const GridSpec& spec, const NpyType& type,
                               const OutputOptions& options) {
  const glm::ivec3 dims = spec.dims;
  std::vector<int64_t> shape = options.axes == AxisOrder::kXyz
                                   ? std::vector<int64_t>{dims.x, dims.y, dims.z}
                                   : std::vector<int64_t>{dims.z, dims.y, dims.x};
  if (type.components > 1) shape.push_back(static_cast<int64_t>(type.components));
  return shape;
}

std::vector<uint8_t> npy_frames_header(const GridSpec& spec, size_t frames,
                                       std::optional<Channel> channel,
                                       const OutputOptions& options) {
  const NpyType type = npy_type(channel, options);
  const bool fortran = options.axes == AxisOrder::kXyz;
  std::vector<int64_t> shape = npy_shape(spec, type, options);
  shape.insert(fortran ? shape.end() : shape.begin(), static_cast<int64_t>(frames));
  return npy_header(type.descr, fortran, shape);
}

std::vector<uint8_t> npy_header(std::string_view descr, bool fortran_order,
                                std::span<const int64_t> shape) {
  constexpr size_t kPreambleBytes = 10, kAlignment = 64;
  std::string text = "{'descr': '" + std::string(descr) +
                     "', 'fortran_order': " + (fortran_order ? "True" : "False") + ", 'shape': (";
  for (const int64_t side : shape) text += std::to_string(side) + ", ";
  text += "), }";
  while ((kPreambleBytes + text.size() + 1) % kAlignment != 0) text += ' ';
  text += '\n';
  std::string header = "\x93NUMPY";
  header += '\x01';
  header += '\x00';
  header += static_cast<char>(text.size() & 0xff);
  header += static_cast<char>(text.size() >> 8);
  header += text;
  return {header.begin(), header.end()};
}

std::vector<uint8_t> npy_doubles(std::span<const double> values) {
  return npy_values("<f8", values);
}

std::vector<uint8_t> npy_integers(std::span<const int64_t> values) {
  return npy_values("<i8", values);
}

std::vector<uint8_t> npy_text(std::string_view text) {
  const int64_t shape[] = {static_cast<int64_t>(text.size())};
  std::vector<uint8_t> bytes = npy_header("|u1", false, shape);
  bytes.insert(bytes.end(), text.begin(), text.end());
  return bytes;
}

Status append_pieces(OutputFile& file, const ArrayPieces& array) {
  const uint64_t begin = file.size();
  VOXELD_TRY(file.extend(array.bytes()));
  std::mutex mutex;
  Status status;
  // Pieces are written by the threads that make them: the system's copy of them takes as long as
  // the making.
  ThreadPool::shared().for_each(array.piece_count(), [&](size_t i) {
    cancel_point();  // on the calling thread
    static thread_local std::vector<uint8_t> bytes;
    bytes.resize(array.piece_bytes(i));
    array.fill(i, bytes);
    const Status written = file.replace(begin + array.piece_begin(i), bytes);
    const std::lock_guard lock(mutex);
    if (!written) status = written;
  });
  return status;
}

Status encode_npy(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  if (options.layout == ArrayLayout::kSparse) {
    const VoxelPieces voxels(grid);
    VOXELD_TRY(check_sparse(voxels.voxel_count(), options.format));
    VOXELD_TRY(file.append(coords_header(voxels.voxel_count(), false)));
    return append_pieces(file, SparseArray::coords(voxels, std::nullopt));
  }
  const DenseArray array(grid, std::nullopt, options);
  VOXELD_TRY(file.append(array.header()));
  return append_pieces(file, array);
}

}  // namespace voxeld
