#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <optional>

#include <nlohmann/json.hpp>

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

template <typename T>
void fill_occupancy(const Grid& grid, Array& array) {
  for_each_cell(grid, [&](const SparseTile&, int x, int y, int z, size_t) {
    array.set(array.layout.at(x, y, z, 0), T{1});
  });
  for (const SparseTile& tile : grid.tiles) {
    cancel_point();
    for_each_full_run(tile, [&](int x, int y, int z, int length) {
      const size_t first = array.layout.at(x, y, z, 0);
      if constexpr (sizeof(T) == 1) {
        std::memset(array.bytes.data() + array.data + first, 1, static_cast<size_t>(length));
      } else {
        for (size_t i = 0; i < static_cast<size_t>(length); ++i) array.set(first + i, T{1});
      }
    });
  }
}

}  // namespace

NpyType npy_type(std::optional<Channel> channel, const OutputOptions& options) {
  const size_t components = channel ? channel_info(*channel).components : 1;
  const NpyType floats = {"<f4", 4, components};
  if (channel == Channel::kMaterial || channel == Channel::kLabel) return {"<u2", 2, components};
  if (channel == Channel::kDistance || options.dtype == DType::kFloat32) return floats;
  if (channel == Channel::kNormal) return {"|i1", 1, components};
  const bool is_bool = !channel && options.dtype == DType::kBool;
  return {is_bool ? "|b1" : "|u1", 1, components};
}

std::vector<uint8_t> npy_channel(const Grid& grid, std::optional<Channel> channel,
                                 const OutputOptions& options) {
  if (!channel) return npy_occupancy(grid, options);
  switch (*channel) {
    case Channel::kColor:
      return npy_color(grid, options);
    case Channel::kNormal:
      return npy_normal(grid, options);
    case Channel::kMaterial:
    case Channel::kLabel:
      return npy_ids(grid, *channel, options);
    case Channel::kDistance:
      return npy_distance(grid, options);
    case Channel::kCoverage:
      return npy_coverage(grid, options);
  }
  return {};
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
  constexpr size_t kPrefix = 10, kAlignment = 64;
  std::string text = "{'descr': '" + std::string(descr) +
                     "', 'fortran_order': " + (fortran_order ? "True" : "False") + ", 'shape': (";
  for (const int64_t side : shape) text += std::to_string(side) + ", ";
  text += "), }";
  while ((kPrefix + text.size() + 1) % kAlignment != 0) text += ' ';
  text += '\n';
  std::string header = "\x93NUMPY";
  header += '\x01';
  header += '\x00';
  header += static_cast<char>(text.size() & 0xff);
  header += static_cast<char>(text.size() >> 8);
  header += text;
  return {header.begin(), header.end()};
}

std::vector<uint8_t> npy_occupancy(const Grid& grid, const OutputOptions& options) {
  const bool is_float = options.dtype == DType::kFloat32;
  Array array = make_array(grid, options, std::nullopt);
  is_float ? fill_occupancy<float>(grid, array) : fill_occupancy<uint8_t>(grid, array);
  return std::move(array.bytes);
}

std::vector<uint8_t> npy_color(const Grid& grid, const OutputOptions& options) {
  const bool is_float = options.dtype == DType::kFloat32;
  Array array = make_array(grid, options, Channel::kColor);
  for_each_cell(grid, [&](const SparseTile& tile, int x, int y, int z, size_t voxel) {
    for (size_t c = 0; c < 4; ++c) {
      const uint8_t sample = tile.color[4 * voxel + c];
      const size_t at = array.layout.at(x, y, z, c);
      if (!is_float) {
        array.set(at, sample);
      } else {
        array.set(at, c == 3 ? static_cast<float>(sample) / 255 : linear_from_srgb(sample));
      }
    }
  });
  return std::move(array.bytes);
}

std::vector<uint8_t> npy_normal(const Grid& grid, const OutputOptions& options) {
  const bool is_float = options.dtype == DType::kFloat32;
  Array array = make_array(grid, options, Channel::kNormal);
  for_each_cell(grid, [&](const SparseTile& tile, int x, int y, int z, size_t voxel) {
    for (size_t c = 0; c < 3; ++c) {
      const int8_t sample = tile.normal[3 * voxel + c];
      const size_t at = array.layout.at(x, y, z, c);
      is_float ? array.set(at, static_cast<float>(sample) / 127) : array.set(at, sample);
    }
  });
  return std::move(array.bytes);
}

std::vector<uint8_t> npy_ids(const Grid& grid, Channel channel, const OutputOptions& options) {
  Array array = make_array(grid, options, channel);
  for_each_cell(grid, [&](const SparseTile& tile, int x, int y, int z, size_t voxel) {
    const auto& ids = channel == Channel::kMaterial ? tile.material : tile.label;
    array.set(array.layout.at(x, y, z, 0), ids[voxel]);
  });
  return std::move(array.bytes);
}

std::vector<uint8_t> npy_coverage(const Grid& grid, const OutputOptions& options) {
  const bool is_float = options.dtype == DType::kFloat32;
  Array array = make_array(grid, options, Channel::kCoverage);
  for_each_cell(grid, [&](const SparseTile& tile, int x, int y, int z, size_t voxel) {
    const uint8_t sample = tile.coverage[voxel];
    const size_t at = array.layout.at(x, y, z, 0);
    is_float ? array.set(at, static_cast<float>(sample) / 255) : array.set(at, sample);
  });
  // Voxels of full nodes are entirely covered.
  for (const SparseTile& tile : grid.tiles) {
    cancel_point();
    for_each_full_run(tile, [&](int x, int y, int z, int length) {
      const size_t first = array.layout.at(x, y, z, 0);
      for (size_t i = 0; i < static_cast<size_t>(length); ++i) {
        is_float ? array.set(first + i, 1.0F) : array.set(first + i, uint8_t{255});
      }
    });
  }
  return std::move(array.bytes);
}

namespace {

// The value of cells without a distance in a dense array.
struct DistanceBackground {
  bool is_band = false;  // true: the sign of their neighbours; false: outside
  float voxels = 0;
};

DistanceBackground distance_background(const Grid& grid) {
  const auto meta = nlohmann::json::parse(grid.meta_json, nullptr, false);
  const auto options =
      meta.is_object() && meta.contains("options") ? meta["options"] : nlohmann::json::object();
  DistanceBackground background;
  background.is_band = options.is_object() && options.value("fill", nlohmann::json()) == "band";
  int farthest = 1;
  for (const SparseTile& tile : grid.tiles) {
    for (const int16_t distance : tile.distance) farthest = std::max(farthest, std::abs(distance));
  }
  background.voxels = static_cast<float>(farthest) / static_cast<float>(kDistanceSteps);
  return background;
}

}  // namespace

std::vector<uint8_t> npy_distance(const Grid& grid, const OutputOptions& options) {
  Array array = make_array(grid, options, Channel::kDistance);
  const DistanceBackground background = distance_background(grid);
  // The cast is aligned: the header's length is a multiple of 64 bytes.
  const std::span<float> cells(reinterpret_cast<float*>(array.bytes.data() + array.data),
                               array.layout.cells);
  std::ranges::fill(cells, background.is_band ? NAN : background.voxels);
  for_each_cell(grid, [&](const SparseTile& tile, int x, int y, int z, size_t voxel) {
    array.set(array.layout.at(x, y, z, 0),
              static_cast<float>(tile.distance[voxel]) / static_cast<float>(kDistanceSteps));
  });
  for (const SparseTile& tile : grid.tiles) {
    cancel_point();
    for_each_full_run(tile, [&](int x, int y, int z, int length) {
      std::ranges::fill(cells.subspan(array.layout.at(x, y, z, 0), static_cast<size_t>(length)),
                        -background.voxels);
    });
  }
  const glm::uvec3 dims(grid.spec.dims);
  if (background.is_band) extend_sign(cells, {dims.z, dims.y, dims.x}, background.voxels);
  return std::move(array.bytes);
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
  return npy_occupancy(grid, options);
}

}  // namespace voxeld
