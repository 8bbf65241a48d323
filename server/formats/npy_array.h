// NumPy's .npy, format version 1.0: magic, header, raw samples. Used by npy and npz.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/options.h"
#include "server/grid/grid.h"

namespace voxeld {

// Header of an array: 10 + n bytes, a multiple of 64, ended by a newline. `descr` is NumPy's type
// text ("|u1", "<f8").
std::vector<uint8_t> npy_header(std::string_view descr, bool fortran_order,
                                std::span<const int64_t> shape);

// What the samples of a channel are (nullopt: occupancy).
struct NpyType {
  std::string_view descr;
  size_t sample_bytes;
  size_t components;  // samples of a voxel
};
NpyType npy_type(std::optional<Channel> channel, const OutputOptions& options);

// A whole .npy file of a channel (nullopt: occupancy), by the functions below.
std::vector<uint8_t> npy_channel(const Grid& grid, std::optional<Channel> channel,
                                 const OutputOptions& options);
// Where its samples begin.
size_t npy_data_begin(std::span<const uint8_t> npy);
// Header of the array whose samples are those of the frames' arrays, one after the other: frames
// are the first axis in C order and the last one in Fortran order.
std::vector<uint8_t> npy_frames_header(const GridSpec& spec, size_t frames,
                                       std::optional<Channel> channel,
                                       const OutputOptions& options);

// Whole .npy files. The memory is the same for both axis orders, x fastest: C order (z, y, x) or
// Fortran order (x, y, z); channels of a sample are last and fastest in C order.
std::vector<uint8_t> npy_occupancy(const Grid& grid, const OutputOptions& options);
// (z, y, x, 4) or (x, y, z, 4): sRGB bytes and alpha; float32: linear light, 0..1. Voxels without
// attributes, those of full nodes, are 0 with alpha 0, as empty cells are.
std::vector<uint8_t> npy_color(const Grid& grid, const OutputOptions& options);
// (z, y, x, 3) or (x, y, z, 3): int8 unit normal times 127; float32: -1..1. 0 where a
// voxel has none.
std::vector<uint8_t> npy_normal(const Grid& grid, const OutputOptions& options);
// (z, y, x) or (x, y, z): uint16 ids, whatever dtype says. 0 where a voxel has none.
std::vector<uint8_t> npy_ids(const Grid& grid, Channel channel, const OutputOptions& options);
// Likewise: uint8, 255 for a voxel that is covered; float32: 0..1.
std::vector<uint8_t> npy_coverage(const Grid& grid, const OutputOptions& options);
// Likewise: float32, whatever dtype says: samples divided by kDistanceSteps, in voxels.
std::vector<uint8_t> npy_distance(const Grid& grid, const OutputOptions& options);
std::vector<uint8_t> npy_doubles(std::span<const double> values);
std::vector<uint8_t> npy_text(std::string_view text);

}  // namespace voxeld
