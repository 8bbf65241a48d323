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

// A whole .npy file of a channel (nullopt: occupancy). Both axis orders have the same memory
// layout, x fastest: C order (z, y, x) or Fortran order (x, y, z). In C order the components of a
// sample are last and fastest. As float32: occupancy 0 or 1; colour in linear light, 0..1; unit
// vectors -1..1; fractions 0..1. Ids are integers and distances are float32, in voxels, for every
// dtype. Cells without attributes, those inside full nodes among them, are 0 (colour with alpha 0);
// there, a fraction is 1 and a distance continues that of the surface.
std::vector<uint8_t> npy_channel(const Grid& grid, std::optional<Channel> channel,
                                 const OutputOptions& options);
// The offset at which the samples begin.
size_t npy_data_begin(std::span<const uint8_t> npy);
// The header of an array with the samples of all frames, one frame after the other. Frames are the
// first axis in C order and the last one in Fortran order.
std::vector<uint8_t> npy_frames_header(const GridSpec& spec, size_t frames,
                                       std::optional<Channel> channel,
                                       const OutputOptions& options);

// One-dimensional arrays.
std::vector<uint8_t> npy_doubles(std::span<const double> values);
std::vector<uint8_t> npy_text(std::string_view text);

}  // namespace voxeld
