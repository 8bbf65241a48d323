// The destination of a grid's tiles as they are made: a Grid, or a file if the grid is larger than
// memory.
#pragma once

#include <utility>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/result.h"
#include "server/grid/grid.h"

namespace voxeld {

class TileSink {
 public:
  virtual ~TileSink() = default;

  // Called once before the first tile. `grid` has the place and the channels, but no tiles.
  virtual Status begin(const Grid& grid) = 0;
  // Takes canonical nonempty tiles, in ascending Morton order of coord over all calls.
  virtual Status add(std::vector<SparseTile> tiles) = 0;
  // True if tiles stay in memory, so that all of them must fit.
  virtual bool keeps_tiles() const = 0;

  // Called after begin(), for surfaces only, because their tiles are final at once. A sink that has
  // the tiles of the first n of `steps` steps from an earlier attempt returns n. The first tiles
  // added then follow those. Equal requests have equal steps.
  virtual Result<size_t> resume(size_t /*steps*/) { return size_t{0}; }
  // Called when all tiles of the first `steps_done` steps were added.
  virtual Status reached(size_t /*steps_done*/) { return {}; }
};

class GridSink : public TileSink {
 public:
  explicit GridSink(Grid& grid) : grid_(grid) {}
  Status begin(const Grid& grid) override {
    grid_ = grid;
    return {};
  }
  Status add(std::vector<SparseTile> tiles) override {
    for (SparseTile& tile : tiles) grid_.tiles.push_back(std::move(tile));
    return {};
  }
  bool keeps_tiles() const override { return true; }

 private:
  Grid& grid_;
};

}  // namespace voxeld
