// The implementation of Grid.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/include/voxeld/client.h"
#include "proto/container/grid_format.h"
#include "proto/result.h"

namespace voxeld::client {

struct Grid::Impl {
  GridHeader header;
  std::vector<SparseTile> tiles;                     // in Morton order of coord
  std::vector<std::vector<uint32_t>> brick_offsets;  // voxels before each brick of a tile
  uint64_t voxels = 0;
  double distance_unit = 1;
  std::string id;                  // of the daemon's grid; empty: none
  std::optional<Settings> daemon;  // which has that grid

  static std::unique_ptr<Impl> of(GridHeader header, std::vector<SparseTile> tiles,
                                  uint64_t voxels);

  // The tile and voxel number of an occupied cell; kNoAttributes in a full node.
  struct Place {
    const SparseTile* tile;
    size_t voxel;
  };
  std::optional<Place> find(int x, int y, int z) const;
  // The voxel `number` at a cell.
  Voxel read(const SparseTile& tile, int x, int y, int z, size_t number) const;
  std::optional<Place> find_in_brick(const SparseTile& tile, uint32_t brick_code,
                                     uint32_t bit) const;
};

// Throws Error "bad-response".
template <typename T>
T checked(Result<T> result) {
  if (result.ok()) return std::move(result).value();
  throw Error("bad-response", 0, result.error().detail, result.error().expected,
              result.error().got);
}

}  // namespace voxeld::client
