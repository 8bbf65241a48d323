// The dense array of a grid's channel as formats of volumes hold it, made in pieces.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "proto/options/options.h"
#include "server/formats/npy/array_pieces.h"
#include "server/formats/npy/dense_array.h"
#include "server/formats/zip/deflate_stream.h"
#include "server/grid/grid.h"

namespace voxeld::volume {

// The types of samples. Numbers of more than one byte are little-endian.
enum class SampleType { kUint8, kInt8, kUint16, kFloat32 };

struct ArrayType {
  SampleType sample;
  size_t sample_bytes;
  size_t components;  // samples of a cell
};
// The type of an array of occupancy (nullopt) or a channel.
ArrayType array_type(std::optional<Channel> channel, const OutputOptions& options);

// The order of a sample's components: beside each other, or each in an array of its own.
enum class Components { kInterleaved, kPlanar };

// The samples of occupancy (nullopt) or a channel: x fastest, then y, then z, as DenseArray has
// them. Types follow the option dtype: occupancy uint8 0 or 1, colour uint8 RGBA in sRGB, normals
// int8 times 127, coverage uint8 times 255, or all of them float32; ids uint16. Distances are
// float32 in world units; in voxels if those are no cubes, unless distance=world.
class VolumeArray : public ArrayPieces {
 public:
  // The grid outlives the array.
  VolumeArray(const Grid& grid, std::optional<Channel> channel, const OutputOptions& options,
              Components components = Components::kInterleaved);

  size_t piece_count() const override { return array_.piece_count(); }
  uint64_t piece_begin(size_t piece) const override { return array_.piece_begin(piece); }
  void fill(size_t piece, std::span<uint8_t> bytes) const override;
  Repeats repeats() const override { return array_.repeats(); }

 private:
  DenseArray array_;
  double scale_;  // of a distance; 1: as it is
};

// "occupancy" or the channel's name.
std::string_view array_name(std::optional<Channel> channel);

// Appends the samples to a stream.
Status append_pieces(DeflateStream& stream, const ArrayPieces& array);

}  // namespace voxeld::volume
