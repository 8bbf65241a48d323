// The native container: see the byte map in this file (written by the codec's author) and, for
// outsiders, proto/README.md. Breadth-first octree of child masks and attribute streams in Morton
// order, per tile, each zstd-compressed; a directory gives random access by tile.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "proto/result.h"
#include "proto/sparse_tile.h"

namespace voxeld {

// What a container says of the grid as a whole.
struct GridHeader {
  std::array<int32_t, 3> dims{};       // cells
  std::array<double, 3> origin{};      // world position of the min corner of cell 0,0,0
  std::array<double, 3> voxel_size{};  // world units
  bool has_color = false;
  bool has_normal = false;
  std::string meta_json = "{}";  // free JSON object: source, options, pipeline, units, ...
};

// Writes a whole container. Tiles must have distinct coords inside dims; their order does not
// matter (they are stored in Morton order of coord), so equal grids give equal bytes.
Result<std::vector<uint8_t>> encode_grid(const GridHeader& header,
                                         std::span<const SparseTile> tiles);

// Reads a container; every length is checked, so hostile bytes give an Error (malformed-bundle is
// not used: the code is bad-request with "grid container, byte N: ...").
class GridReader {
 public:
  // `bytes` must outlive the reader.
  static Result<GridReader> open(std::span<const uint8_t> bytes);

  const GridHeader& header() const { return header_; }
  size_t tile_count() const { return entries_.size(); }
  std::array<int32_t, 3> tile_coord(size_t index) const;
  uint64_t tile_voxel_count(size_t index) const;
  uint64_t voxel_count() const;
  // Byte range of a tile's data in the container, for range requests.
  std::pair<uint64_t, uint64_t> tile_byte_range(size_t index) const;
  Result<SparseTile> decode_tile(size_t index) const;

 private:
  struct Entry {
    std::array<int32_t, 3> coord;
    uint64_t offset, octree_bytes, color_bytes, normal_bytes, voxel_count, brick_count;
  };
  GridHeader header_;
  std::span<const uint8_t> bytes_;
  std::vector<Entry> entries_;
};

}  // namespace voxeld
