// Where the tiles of a grid go as they are made: into a Grid, or to a file when the grid is larger
// than memory.
#pragma once

#include <utility>
#include <vector>

#include "proto/result.h"
#include "proto/sparse_tile.h"
#include "server/grid/grid.h"

namespace voxeld {

class TileSink {
 public:
  virtual ~TileSink() = default;

  // Called once before the first tile: the grid's place and channels, without tiles.
  virtual Status begin(const Grid& grid) = 0;
  // Canonical tiles that are not empty, in ascending Morton order of coord over all calls.
  virtual Status add(std::vector<SparseTile> tiles) = 0;
  // Whether tiles stay in memory, so that all of them have to fit.
  virtual bool keeps_tiles() const = 0;

  // Of surfaces, whose tiles are final when they come, after begin(): a sink that has the tiles of
  // the first n of so many steps from an earlier attempt returns n; the first tiles that are added
  // come after them. Equal requests have equal steps.
  virtual Result<size_t> resume(size_t /*steps*/) { return size_t{0}; }
  // All tiles of the first so many steps were added.
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
