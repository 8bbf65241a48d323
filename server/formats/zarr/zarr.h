// A Zarr store written from tiles, for grids that need not be in memory.
#pragma once

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/formats/output_file.h"
#include "server/grid/tile_source.h"

namespace voxeld::zarr {

// Writes the store of a grid: options.zarr_version, dtype and level_rule apply. Tiles are read once
// for each level. Equal grids give equal bytes. Errors: storage-full, internal, the source's.
Status write_store(const TileSource& tiles, const GridMeta& meta, const OutputOptions& options,
                   OutputFile& file);

}  // namespace voxeld::zarr
