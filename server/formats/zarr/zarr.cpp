// Writes a Zarr store as a zip whose members are stored, since its chunks are gzip already.
// metadata.h describes the hierarchy. Documents come first, then the chunks level by level.
#include <cmath>

#include "server/formats/formats.h"
#include "server/formats/output_file.h"
#include "server/formats/volume/volume_facts.h"
#include "server/formats/zarr/chunks.h"
#include "server/formats/zarr/metadata.h"
#include "server/formats/zarr/zarr.h"
#include "server/grid/level.h"

namespace voxeld::zarr {
namespace {

Status add_documents(ZipWriter& zip, const Grid& common, const FrameAxis& frames,
                     const OutputOptions& options) {
  for (const Document& document : documents(common, frames, options)) {
    VOXELD_TRY(zip.store(document.path, volume::text_bytes(document.text)));
  }
  return {};
}

// Adds the chunks of all levels of a grid.
Status add_levels(ZipWriter& zip, const TileSource& tiles, std::optional<size_t> frame,
                  const OutputOptions& options) {
  VOXELD_ASSIGN(const float far_voxels, farthest_distance(tiles));
  VOXELD_TRY(add_chunks(zip, tiles, 0, frame, far_voxels, options));
  for (int level = 1; level < level_count(tiles.grid().spec); ++level) {
    const LevelTiles coarse(tiles, level, options.level_rule);
    VOXELD_TRY(add_chunks(zip, coarse, level, frame, std::ldexp(far_voxels, -level), options));
  }
  return {};
}

}  // namespace

Status write_store(const TileSource& tiles, const GridMeta& meta, const OutputOptions& options,
                   OutputFile& file) {
  ZipWriter zip(file);
  Grid common = tiles.grid();
  common.meta = meta;
  VOXELD_TRY(add_documents(zip, common, {}, options));
  VOXELD_TRY(add_levels(zip, tiles, std::nullopt, options));
  return zip.finish();
}

}  // namespace voxeld::zarr

namespace voxeld {

Status encode_zarr(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  return zarr::write_store(GridTiles(grid), grid.meta, options, file);
}

Status write_zarr_sequence(const FrameSource& source, const OutputOptions& options,
                           const std::filesystem::path& path) {
  VOXELD_ASSIGN(OutputFile file, OutputFile::create(path));
  ZipWriter zip(file);
  zarr::FrameAxis frames{.count = source.frame_count()};
  if (source.fps() > 0) {
    frames.step_s = 1 / source.fps();
    frames.begin_s = source.time_s(0);
  }
  VOXELD_TRY(zarr::add_documents(zip, source.common(), frames, options));
  for (size_t i = 0; i < source.frame_count(); ++i) {
    VOXELD_ASSIGN(const Grid frame, source.frame(i));
    VOXELD_TRY(zarr::add_levels(zip, GridTiles(frame), i, options));
  }
  return zip.finish();
}

}  // namespace voxeld
