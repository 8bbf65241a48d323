#include "server/grid/morphology/remap_tiles.h"

#include <algorithm>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/check.h"

namespace voxeld {

RemapTiles::RemapTiles(const TileSource& source, std::vector<LabelChange> changes)
    : source_(source), changes_(std::move(changes)) {
  VOXELD_CHECK(source.grid().channels.label, "labels are remapped where there are some");
  grid_ = source.grid();
  coords_ = source.coords();
}

Result<SparseTile> RemapTiles::tile(size_t index) const {
  VOXELD_ASSIGN(SparseTile tile, source_.tile(index));
  for (uint16_t& label : tile.label) {
    cancel_point();
    const auto at = std::ranges::lower_bound(changes_, label, {}, &LabelChange::from);
    if (at != changes_.end() && at->from == label) label = at->to;
  }
  return tile;
}

}  // namespace voxeld
