// Tiles of a grid that need not be in memory. Levels of detail, regions and images of grids larger
// than memory are made from them, tile by tile.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <mutex>
#include <unordered_map>
#include <vector>

#include <glm/vec3.hpp>

#include "proto/codec/sparse_tile.h"
#include "proto/container/grid_format.h"
#include "proto/result.h"
#include "server/grid/grid.h"

namespace voxeld {

using TileCoord = std::array<int32_t, 3>;  // in tiles

uint32_t coord_order(const TileCoord& coord);

// The grid that a container's header describes, without tiles.
Grid grid_of_header(const GridHeader& header);

class TileSource {
 public:
  virtual ~TileSource() = default;
  TileSource(const TileSource&) = delete;
  TileSource& operator=(const TileSource&) = delete;

  // The grid's placement, channels and meta, without tiles.
  const Grid& grid() const { return grid_; }
  // Coords at which tiles may be, in ascending Morton order.
  const std::vector<TileCoord>& coords() const { return coords_; }
  // The tile at coords()[index]: canonical, possibly empty. Any thread may call it.
  virtual Result<SparseTile> tile(size_t index) const = 0;
  // The tile's voxels, if known without reading it; otherwise 0.
  virtual uint64_t voxels(size_t /*index*/) const { return 0; }
  // How many tiles to request at a time; 1 if a tile uses all cores by itself.
  virtual size_t batch() const = 0;

 protected:
  TileSource() = default;
  Grid grid_;
  std::vector<TileCoord> coords_;
};

// Reads tiles [begin, end) of the source in order, on all cores. Errors: the first of theirs.
Result<std::vector<SparseTile>> read_tiles(const TileSource& source, size_t begin, size_t end);

// Calls take(tiles) for batches of non-empty tiles, in ascending order. Errors: those of the source
// and of `take`.
Status for_each_batch(const TileSource& source,
                      const std::function<Status(std::vector<SparseTile>)>& take);

// The tiles of a native container.
class ContainerTiles final : public TileSource {
 public:
  // `before_tile` is called before each tile, from any thread; its error ends the reading. The
  // reader's bytes must outlive the source.
  explicit ContainerTiles(GridReader reader, std::function<Status()> before_tile = {});

  Result<SparseTile> tile(size_t index) const override;
  uint64_t voxels(size_t index) const override { return reader_.tile_voxel_count(index); }
  size_t batch() const override;

 private:
  GridReader reader_;
  std::function<Status()> before_tile_;
};

// The tiles of a grid in memory, which must outlive the source.
class GridTiles final : public TileSource {
 public:
  explicit GridTiles(const Grid& grid);
  Result<SparseTile> tile(size_t index) const override { return whole_.tiles[index]; }
  uint64_t voxels(size_t index) const override { return whole_.tiles[index].voxel_count(); }
  size_t batch() const override;

 private:
  const Grid& whole_;
};

// The tiles of another source whose coords `wanted` accepts. The source must outlive it.
class SomeTiles final : public TileSource {
 public:
  SomeTiles(const TileSource& source, const std::function<bool(const TileCoord&)>& wanted);
  Result<SparseTile> tile(size_t index) const override { return source_.tile(indexes_[index]); }
  uint64_t voxels(size_t index) const override { return source_.voxels(indexes_[index]); }
  size_t batch() const override { return source_.batch(); }

 private:
  const TileSource& source_;
  std::vector<size_t> indexes_;
};

// Cells [min, max); empty: equal corners.
struct CellBox {
  glm::ivec3 min{0}, max{0};
  bool empty() const { return min == max; }
};

// Caches the tiles that were used last, up to a number of bytes, for callers that read each tile
// several times. The source must outlive it.
class CachedTiles final : public TileSource {
 public:
  explicit CachedTiles(const TileSource& source, size_t bytes_max = size_t{128} << 20);
  Result<SparseTile> tile(size_t index) const override;
  size_t batch() const override { return source_.batch(); }
  // The tiles with an occupied cell that share cells with the box, which is not empty; in order of
  // their places. Errors: the source's.
  Result<std::vector<SparseTile>> tiles_in(const CellBox& cells) const;

 private:
  struct Kept {
    size_t index;
    SparseTile tile;
  };
  const TileSource& source_;
  size_t bytes_max_;
  mutable std::mutex mutex_;
  mutable std::list<Kept> kept_;  // the most recently used first
  mutable std::unordered_map<size_t, std::list<Kept>::iterator> places_;
  mutable size_t bytes_ = 0;
};

// Bytes of a tile's arrays.
size_t tile_bytes(const SparseTile& tile);

// The least box that contains all occupied cells; empty if there are none. Found from only the
// outermost tiles along each axis. Errors: the source's.
Result<CellBox> occupied_box(const TileSource& source);

}  // namespace voxeld
