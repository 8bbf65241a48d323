// A grid without its transparent voxels: those with a colour whose alpha is 0.
#pragma once

#include "proto/options/options.h"
#include "server/grid/tile_source.h"

namespace voxeld {

// Whether files of the request's format have colours with alpha, or no colours.
bool colors_have_alpha(const OutputOptions& options);
// Whether a request leaves transparent voxels out: alpha=cut, or auto with a format whose colours
// have no alpha.
bool cuts_transparent(const OutputOptions& options);

// (0,0,0,0), as inside solids, is no colour.
bool has_transparent_voxels(const SparseTile& tile);
void cut_transparent_voxels(SparseTile& tile, const ChannelSet& channels);
// The grid without its transparent voxels.
Grid without_transparent_voxels(const Grid& grid);

// The tiles of another source without their transparent voxels. The source must outlive it.
class CutTiles final : public TileSource {
 public:
  explicit CutTiles(const TileSource& source);
  Result<SparseTile> tile(size_t index) const override;
  size_t batch() const override { return source_.batch(); }

 private:
  const TileSource& source_;
};

}  // namespace voxeld
