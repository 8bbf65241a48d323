// The values of a grid of a VDB or NanoVDB file, which voxels of a Grid have.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "proto/codec/sparse_tile.h"

namespace voxeld::vdb {

using Vec3s = std::array<float, 3>;

template <typename Value>
class GridValues {
 public:
  virtual ~GridValues() = default;
  GridValues(const GridValues&) = delete;
  GridValues& operator=(const GridValues&) = delete;

  // Writes the values of the voxels with attributes from number `first` in the tile on.
  // Thread-safe.
  virtual void fill(const SparseTile& tile, size_t first, std::span<Value> values) const = 0;

  Value background{};  // of cells without voxels
  Value inner{};       // of voxels of full nodes
  // Whether cells without voxels have minus the background inside of the surface; of floats.
  bool is_signed = false;

 protected:
  GridValues() = default;
};

}  // namespace voxeld::vdb
