#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <optional>

#include "proto/codec/tile_runs.h"
#include "server/base/cancel_point.h"
#include "server/formats/extend_sign.h"
#include "server/formats/formats.h"
#include "server/formats/npy_array.h"

namespace voxeld {
namespace {

float linear_from_srgb(uint8_t byte) {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> made{};
    for (size_t i = 0; i < made.size(); ++i) {
      const double s = static_cast<double>(i) / 255;
      made[i] = static_cast<float>(s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4));
    }
    return made;
  }();
  return table[byte];
}

// The offset of a cell's first sample; x is fastest. In C order the channels are inside the cell;
// in Fortran order each channel is a whole array.
struct Layout {
  size_t nx, ny, cells, channels;
  bool fortran;
  size_t at(int x, int y, int z, size_t channel) const {
    const size_t cell =
        static_cast<size_t>(x) + nx * (static_cast<size_t>(y) + ny * static_cast<size_t>(z));
    return fortran ? cell + channel * cells : cell * channels + channel;
  }
};

// A header and zeroed samples, which begin at `data`.
struct Array {
  std::vector<uint8_t> bytes;
  size_t data = 0;
  Layout layout{};

  template <typename T>
  void set(size_t index, T value) {
    std::memcpy(bytes.data() + data + index * sizeof(T), &value, sizeof(T));
  }
};

// Sides of a grid's array, in the order of its shape.
std::vector<int64_t> shape_of(const GridSpec& spec, const OutputOptions& options,
                              const NpyType& type) {
  const glm::ivec3 dims = spec.dims;
  std::vector<int64_t> shape = options.axes == AxisOrder::kXyz
                                   ? std::vector<int64_t>{dims.x, dims.y, dims.z}
                                   : std::vector<int64_t>{dims.z, dims.y, dims.x};
  if (type.components > 1) shape.push_back(static_cast<int64_t>(type.components));
  return shape;
}

Array make_array(const Grid& grid, const OutputOptions& options, std::optional<Channel> channel) {
  const glm::ivec3 dims = grid.spec.dims;
  const bool fortran = options.axes == AxisOrder::kXyz;
  const NpyType type = npy_type(channel, options);
  const size_t channels = type.components, sample_bytes = type.sample_bytes;
  Array array;
  const std::vector<uint8_t> header =
      npy_header(type.descr, fortran, shape_of(grid.spec, options, type));
  const auto cells = static_cast<size_t>(grid.spec.cell_count());
  // Cleared in steps with cancellation points, because gigabytes take a second.
  constexpr size_t kClearedBytes = size_t{16} << 20;
  const size_t total = header.size() + cells * channels * sample_bytes;
  array.bytes.reserve(total);
  while (array.bytes.size() < total) {
    cancel_point();
    array.bytes.resize(std::min(total, array.bytes.size() + kClearedBytes));
  }
  std::memcpy(array.bytes.data(), header.data(), header.size());
  array.data = header.size();
  array.layout = {static_cast<size_t>(dims.x), static_cast<size_t>(dims.y), cells, channels,
                  fortran};
  return array;
}

// Visits voxels with attributes; those of full nodes have none.
template <typename Visit>
void for_each_cell(const Grid& grid, Visit&& visit) {
  for (const SparseTile& tile : grid.tiles) {
    cancel_point();
    for_each_mask_voxel(tile,
                        [&](int x, int y, int z, size_t voxel) { visit(tile, x, y, z, voxel); });
  }
}

// Calls visit(first, length) for runs of cells in full nodes, as indices of the array's cells.
template <typename Visit>
void for_each_full_cells(const Grid& grid, const Layout& layout, Visit&& visit) {
  for (const SparseTile& tile : grid.tiles) {
    cancel_point();
    for_each_full_run(tile, [&](int x, int y, int z, int length) {
      visit(layout.at(x, y, z, 0), static_cast<size_t>(length));
    });
  }
}

template <typename T>
void fill_occupancy(const Grid& grid, Array& array) {
  for_each_cell(grid, [&](const SparseTile&, int x, int y, int z, size_t) {
    array.set(array.layout.at(x, y, z, 0), T{1});
  });
  for_each_full_cells(grid, array.layout, [&](size_t first, size_t length) {
    if constexpr (sizeof(T) == 1) {
      std::memset(array.bytes.data() + array.data + first, 1, length);
    } else {
      for (size_t i = 0; i < length; ++i) array.set(first + i, T{1});
    }
  });
}

std::vector<uint8_t> npy_occupancy(const Grid& grid, const OutputOptions& options) {
  const bool is_float = options.dtype == DType::kFloat32;
  Array array = make_array(grid, options, std::nullopt);
  is_float ? fill_occupancy<float>(grid, array) : fill_occupancy<uint8_t>(grid, array);
  return std::move(array.bytes);
}

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

// (z, y, x) or (x, y, z), then the components if there are several. float32 divides by the largest
// sample, and colour is made linear; ids are integers for every dtype. Cells without attributes,
// those of full nodes among them, are 0; as a fraction, a cell of a full node is 1.
template <Channel channel, typename Sample>
std::vector<uint8_t> npy_samples(const Grid& grid, std::vector<Sample> SparseTile::*member,
                                 const OutputOptions& options) {
  constexpr const ChannelInfo& kInfo = channel_info(channel);
  constexpr Sample kLargest = std::numeric_limits<Sample>::max();
  const bool is_float = !kInfo.is_id() && options.dtype == DType::kFloat32;
  Array array = make_array(grid, options, channel);
  const auto set = [&](size_t at, size_t component, Sample sample) {
    if (!is_float) {
      array.set(at, sample);
    } else if (kInfo.kind == ChannelKind::kColor && component < 3) {
      array.set(at, linear_from_srgb(static_cast<uint8_t>(sample)));
    } else {
      array.set(at, static_cast<float>(sample) / static_cast<float>(kLargest));
    }
  };
  for_each_cell(grid, [&](const SparseTile& tile, int x, int y, int z, size_t voxel) {
    for (size_t c = 0; c < kInfo.components; ++c) {
      set(array.layout.at(x, y, z, c), c, (tile.*member)[kInfo.components * voxel + c]);
    }
  });
  if constexpr (kInfo.kind == ChannelKind::kFraction) {
    for_each_full_cells(grid, array.layout, [&](size_t first, size_t length) {
      for (size_t i = 0; i < length; ++i) set(first + i, 0, kLargest);
    });
  }
  return std::move(array.bytes);
}

// The value of cells without a distance in a dense array.
struct DistanceBackground {
  bool is_band = false;  // true: the sign of their neighbours; false: outside
  float voxels = 0;
};

DistanceBackground distance_background(const Grid& grid, auto member) {
  DistanceBackground background{.is_band = grid.meta.is_band()};
  int farthest = 1;
  for (const SparseTile& tile : grid.tiles) {
    for (const int16_t distance : tile.*member) farthest = std::max(farthest, std::abs(distance));
  }
  background.voxels = static_cast<float>(farthest) / static_cast<float>(kDistanceSteps);
  return background;
}

// The same shape: float32 for every dtype; samples divided by kDistanceSteps, in voxels.
std::vector<uint8_t> npy_distances(const Grid& grid, Channel channel, auto member,
                                   const OutputOptions& options) {
  Array array = make_array(grid, options, channel);
  const DistanceBackground background = distance_background(grid, member);
  // The cast is aligned: the header's length is a multiple of 64 bytes.
  const std::span<float> cells(reinterpret_cast<float*>(array.bytes.data() + array.data),
                               array.layout.cells);
  std::ranges::fill(cells, background.is_band ? NAN : background.voxels);
  for_each_cell(grid, [&](const SparseTile& tile, int x, int y, int z, size_t voxel) {
    array.set(array.layout.at(x, y, z, 0),
              static_cast<float>((tile.*member)[voxel]) / static_cast<float>(kDistanceSteps));
  });
  for_each_full_cells(grid, array.layout, [&](size_t first, size_t length) {
    std::ranges::fill(cells.subspan(first, length), -background.voxels);
  });
  const glm::uvec3 dims(grid.spec.dims);
  if (background.is_band) extend_sign(cells, {dims.z, dims.y, dims.x}, background.voxels);
  return std::move(array.bytes);
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

std::vector<uint8_t> npy_channel(const Grid& grid, std::optional<Channel> channel,
                                 const OutputOptions& options) {
  if (!channel) return npy_occupancy(grid, options);
  std::vector<uint8_t> npy;
  with_channel_member(*channel, [&](auto which, auto member) {
    if constexpr (channel_info(which).kind == ChannelKind::kDistance) {
      npy = npy_distances(grid, which, member, options);
    } else {
      npy = npy_samples<which()>(grid, member, options);
    }
  });
  return npy;
}

std::vector<uint8_t> npy_frames_header(const GridSpec& spec, size_t frames,
                                       std::optional<Channel> channel,
                                       const OutputOptions& options) {
  const NpyType type = npy_type(channel, options);
  const bool fortran = options.axes == AxisOrder::kXyz;
  std::vector<int64_t> shape = shape_of(spec, options, type);
  shape.insert(fortran ? shape.end() : shape.begin(), static_cast<int64_t>(frames));
  return npy_header(type.descr, fortran, shape);
}

size_t npy_data_begin(std::span<const uint8_t> npy) {
  return size_t{10} + npy[8] + (size_t{npy[9]} << 8);
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
  const int64_t shape[] = {static_cast<int64_t>(values.size())};
  std::vector<uint8_t> bytes = npy_header("<f8", false, shape);
  const auto* data = reinterpret_cast<const uint8_t*>(values.data());
  bytes.insert(bytes.end(), data, data + values.size_bytes());
  return bytes;
}

std::vector<uint8_t> npy_text(std::string_view text) {
  const int64_t shape[] = {static_cast<int64_t>(text.size())};
  std::vector<uint8_t> bytes = npy_header("|u1", false, shape);
  bytes.insert(bytes.end(), text.begin(), text.end());
  return bytes;
}

Result<std::vector<uint8_t>> encode_npy(const Grid& grid, const OutputOptions& options) {
  return npy_channel(grid, std::nullopt, options);
}

}  // namespace voxeld
