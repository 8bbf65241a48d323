// NumPy's .npy, format version 1.0: magic, header, raw samples. npy and npz use it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/options/options.h"
#include "server/grid/grid.h"

namespace voxeld {

// The header of an array: 10 + n bytes, a multiple of 64, ended by a newline. `descr` is NumPy's
// type text ("|u1", "<f8").
std::vector<uint8_t> npy_header(std::string_view descr, bool fortran_order,
                                std::span<const int64_t> shape);

// The sample type of a channel (nullopt: occupancy).
struct NpyType {
  std::string_view descr;
  size_t sample_bytes;
  size_t components;  // samples of a voxel
};
NpyType npy_type(std::optional<Channel> channel, const OutputOptions& options);

// A whole .npy file of a channel (nullopt: occupancy), made by the functions below.
std::vector<uint8_t> npy_channel(const Grid& grid, std::optional<Channel> channel,
                                 const OutputOptions& options);
// The offset at which the samples begin.
size_t npy_data_begin(std::span<const uint8_t> npy);
// The header of an array with the samples of all frames, one frame after the other. Frames are the
// first axis in C order and the last one in Fortran order.
std::vector<uint8_t> npy_frames_header(const GridSpec& spec, size_t frames,
                                       std::optional<Channel> channel,
                                       const OutputOptions& options);

// Each returns a whole .npy file. Both axis orders have the same memory layout, x fastest: C order
// (z, y, x) or Fortran order (x, y, z). In C order the channels of a sample are last and fastest.
std::vector<uint8_t> npy_occupancy(const Grid& grid, const OutputOptions& options);
// (z, y, x, 4) or (x, y, z, 4): sRGB bytes and alpha; float32: linear light, 0..1. Voxels without
// attributes (those of full nodes) are 0 with alpha 0, like empty cells.
std::vector<uint8_t> npy_color(const Grid& grid, const OutputOptions& options);
// (z, y, x, 3) or (x, y, z, 3): int8 unit normal times 127; float32: -1..1. 0 for a voxel without a
// normal.
std::vector<uint8_t> npy_normal(const Grid& grid, const OutputOptions& options);
// (z, y, x) or (x, y, z): uint16 ids for every dtype. 0 for a voxel without an id.
std::vector<uint8_t> npy_ids(const Grid& grid, Channel channel, const OutputOptions& options);
// The same shape: uint8, 255 for a covered voxel; float32: 0..1.
std::vector<uint8_t> npy_coverage(const Grid& grid, const OutputOptions& options);
// The same shape: float32 for every dtype; samples divided by kDistanceSteps, in voxels.
std::vector<uint8_t> npy_distance(const Grid& grid, const OutputOptions& options);
std::vector<uint8_t> npy_doubles(std::span<const double> values);
std::vector<uint8_t> npy_text(std::string_view text);

}  // namespace voxeld
