// The chunks of a Zarr store's arrays, made from tiles.
#pragma once

#include <cstddef>
#include <optional>

#include "proto/options/options.h"
#include "server/formats/zip/zip_writer.h"
#include "server/grid/tile_source.h"

namespace voxeld::zarr {

// The largest distance of the grid's voxels, in distance_unit(); 0 if it has no distances. Errors:
// the source's.
Result<float> farthest_distance(const TileSource& source);

// Adds the chunks of a level of a grid to the archive, in the order of its tiles: those of
// occupancy, then those of each channel. Chunks are deflated on all threads; in memory are some of
// them and a batch of tiles. Chunks that have only the fill value are absent.
// far_voxels: farthest_distance() in the unit of the level, for cells inside of a solid.
// frame: nullopt for a grid. Errors: storage-full, the source's.
Status add_chunks(ZipWriter& zip, const TileSource& tiles, int level, std::optional<size_t> frame,
                  float far_voxels, const OutputOptions& options);

}  // namespace voxeld::zarr
