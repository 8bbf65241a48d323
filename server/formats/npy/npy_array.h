// NumPy's .npy, format version 1.0: magic, header, raw samples. npy and npz use it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/grid/grid.h"

namespace voxeld {

class ZipWriter;

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

// Sides of a grid's array, in the order of its shape.
std::vector<int64_t> npy_shape(const GridSpec& spec, const NpyType& type,
                               const OutputOptions& options);
// The header of an array with the samples of all frames, one frame after the other. Frames are the
// first axis in C order and the last one in Fortran order.
std::vector<uint8_t> npy_frames_header(const GridSpec& spec, size_t frames,
                                       std::optional<Channel> channel,
                                       const OutputOptions& options);

// One-dimensional arrays.
std::vector<uint8_t> npy_doubles(std::span<const double> values);
std::vector<uint8_t> npy_integers(std::span<const int64_t> values);
std::vector<uint8_t> npy_text(std::string_view text);

// Adds the members that place a grid or sequence in the world, and its meta.
Status add_placement(ZipWriter& zip, const Grid& grid, const OutputOptions& options);

}  // namespace voxeld
