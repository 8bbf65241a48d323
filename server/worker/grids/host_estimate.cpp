#include "server/worker/grids/host_estimate.h"

#include <algorithm>
#include <thread>

#include "proto/limits.h"
#include "proto/minecraft_blocks.h"
#include "server/formats/formats.h"
#include "server/formats/native_sequence.h"
#include "server/grid/morphology/step_tiles.h"
#include "server/grid/region.h"
#include "server/process/machine.h"
#include "server/worker/grids/grid_file.h"

namespace voxeld {
namespace {

constexpr int64_t kMebi = int64_t{1} << 20;
constexpr int64_t kBrickCells =
    int64_t{limits::kBrickSide} * limits::kBrickSide * limits::kBrickSide;
constexpr int64_t kTileCells = int64_t{limits::kTileSide} * limits::kTileSide * limits::kTileSide;

// Memory that a thread of the CPU pipeline, an encoder and the allocator hold: a generous guess.
constexpr int64_t kThreadBytes = 24 * kMebi;
// Shaders, windows of triangles and sums of attributes of a software driver.
constexpr int64_t kSoftwareDeviceBytes = 512 * kMebi;
// Grids with a smaller dense size are not examined more closely.
constexpr int64_t kDenseBytesMin = 64 * kMebi;
// Records of the corners of one triangle (server/voxel/attributes/attribute_records.h), including
// the buffers that sort them.
constexpr int64_t kRecordBytes = 256;

int64_t threads() {
  return std::max(1u, std::thread::hardware_concurrency());
}

int64_t image_bytes(const Scene& scene) {
  int64_t bytes = 0;
  for (const Image& image : scene.images) bytes += static_cast<int64_t>(image.rgba.size());
  return bytes;
}

// Bytes of a voxel in a kept tile: its share of a brick, and its attributes.
constexpr int64_t kListedVoxelBytes = 84;

// Memory of a mesh for each voxel with an outer face: about 3 rectangles, their triangles, and
// corners of a colour of their own.
constexpr int64_t kMeshBytes = 384;
// Voxels with an outer face in a tile: a surface that crosses it twice, a guess.
constexpr int64_t kTileSurfaceVoxels = int64_t{2} * limits::kTileSide * limits::kTileSide;

// Order and errors of the voxels that are diffused at once (server/grid/color/palette_entries.cpp).
int64_t dither_bytes(int64_t voxels, const OutputOptions& output) {
  constexpr int64_t kDiffusedBytes = 20;
  if (output.dither != Dither::kError) return 0;
  return std::min(voxels, threads() * kTileCells) * kDiffusedBytes;
}

// The memory of an encoder of whole grids. Sparse arrays and some formats of points are written in
// pieces, and so are files of blocks, which take a byte for each voxel. Other points: the file, and
// a copy while it grows. Dense arrays: the list of bricks and that of their rows, all cells of a
// band of distances, and the pieces that are cut into blocks.
int64_t encoded_bytes(const GridSpec& spec, int64_t voxels, const ChannelSet& channels,
                      const OutputOptions& output) {
  constexpr int64_t kListedBytes = 24;  // of a brick
  constexpr int64_t kRowBytes = 16;     // of a row of bricks
  constexpr int64_t kBlockBytes = 64 * kMebi;
  constexpr auto kDistanceBytes = static_cast<int64_t>(sizeof(float));
  const FileLayout layout = output.file_layout();
  if (layout.kind == FileLayout::kTiles || layout.kind == FileLayout::kSparseArrays) return 0;
  const bool has_blocks = holds_blocks(output.format);
  const int64_t blocks = (has_blocks ? voxels : 0) + dither_bytes(voxels, output);
  if (layout.kind == FileLayout::kPoints) {
    if (has_blocks) return blocks;
    return is_written_in_pieces(output.format) ? 0 : 2 * voxels * layout.point_bytes + blocks;
  }
  if (layout.kind == FileLayout::kSurface) return voxels * kMeshBytes;
  const bool has_band = layout.kind == FileLayout::kDenseChannels
                            ? channels.distance
                            : output.channel == Channel::kDistance;
  const int64_t cells = spec.cell_count();
  const auto bricks_along = [&](int axis) {
    return int64_t{(spec.dims[axis] + limits::kBrickSide - 1) / limits::kBrickSide};
  };
  const int64_t rows = bricks_along(1) * bricks_along(2);
  return std::min(voxels, bricks_along(0) * rows) * kListedBytes + rows * kRowBytes +
         std::min(kBlockBytes, 2 * cells * static_cast<int64_t>(sizeof(float))) +
         (has_band ? cells * kDistanceBytes : 0) + blocks;
}

int64_t tile_voxels_max(const TileSource& source, size_t index) {
  const auto known = static_cast<int64_t>(source.voxels(index));
  return known > 0 ? known : std::min(kTileCells, source.grid().spec.cell_count());
}

// Upper bound of one decoded tile: one brick per voxel, and attributes.
int64_t tile_bytes_max(const TileSource& source, size_t index) {
  const int64_t voxels = tile_voxels_max(source, index);
  const int64_t bricks = std::min(voxels, kTileCells / kBrickCells);
  const Grid& grid = source.grid();
  const auto values = static_cast<int64_t>(attribute_bytes(grid.channels));
  return bricks * static_cast<int64_t>(sizeof(BrickMask) + sizeof(uint32_t)) + voxels * values;
}

int64_t largest_tile_bytes(const TileSource& source) {
  int64_t bytes = 0;
  for (size_t i = 0; i < source.coords().size(); ++i) {
    bytes = std::max(bytes, tile_bytes_max(source, i));
  }
  return bytes;
}

struct GridSize {
  int64_t bytes = 0;  // with its tiles in memory
  int64_t voxels = 0;
  int64_t tree_bytes = 0;  // of the mesh's triangles, while it is made
};

// Tiles that stages of steps keep, and the bits of the tile that each thread makes; runs of cells
// and components of voxels.
int64_t morphology_bytes(const TileSource& source, const OutputOptions& output) {
  constexpr int64_t kKeptBytes = 128 * kMebi;  // by a stage: CachedTiles
  constexpr int64_t kRunBytes = 16;            // of a run with its set
  constexpr int64_t kRunVoxels = 4;            // in a run, a guess
  constexpr int64_t kOpenTiles = 64;           // that others still touch, a guess
  constexpr int64_t kTileBits = kTileCells / 8;
  int64_t stages = 0, voxels = 0, largest = 0;
  for (const int steps : {output.dilate, output.erode, output.hollow}) stages += steps > 0 ? 1 : 0;
  for (size_t i = 0; i < source.coords().size(); ++i) {
    const auto in_tile = static_cast<int64_t>(source.voxels(i));
    voxels += in_tile;
    largest = std::max(largest, in_tile);
  }
  const int steps = std::max({output.dilate, output.erode, output.hollow});
  const int64_t windows =
      steps > 0 ? threads() * step_tile_bytes(steps, source.grid().channels) : 0;
  const int64_t kept = std::min(kKeptBytes, voxels * kListedVoxelBytes) * stages;
  if (output.keep == 0) return windows + kept;
  const int64_t runs = std::min(voxels, (kOpenTiles + threads()) * largest) / kRunVoxels;
  return windows + kept + runs * kRunBytes + threads() * kTileBits;
}

GridSize grid_size(const Engine& engine, const Scene& scene, const RequestOptions& options,
                   const Placed& placed) {
  const VoxelizeOptions& asked = options.voxelize;
  const GridSize dense = {dense_result_bytes(placed.spec, wanted_channels(scene, asked)),
                          placed.spec.cell_count()};
  if (!asked.needs_whole_surface() && dense.bytes <= kDenseBytesMin) return dense;
  const auto closer = engine.voxelizer.estimate(scene, asked);
  if (!closer) return dense;
  return {std::min(dense.bytes, closer->host_bytes - closer->tree_bytes),
          std::min(dense.voxels, closer->voxels), closer->tree_bytes};
}

// Voxels that a mesh or another encoder of whole grids writes. The inside of a solid has no faces;
// a shell and a band have two surfaces.
int64_t written_voxels(const Engine& engine, const Scene& scene, const RequestOptions& options,
                       const GridSize& size) {
  if (!options.output.file_layout().is_mesh()) return size.voxels;
  if (options.voxelize.fill == Fill::kSurface) return size.voxels;
  VoxelizeOptions surface = options.voxelize;
  surface.fill = Fill::kSurface;
  const auto estimate = engine.voxelizer.estimate(scene, surface);
  return estimate ? std::min(size.voxels, 2 * estimate->voxels) : size.voxels;
}

}  // namespace

int64_t grid_bytes(const Engine& engine, const Scene& scene, const RequestOptions& options,
                   const Placed& placed) {
  return grid_size(engine, scene, options, placed).bytes;
}

int64_t sequence_bytes(int64_t frame_bytes) {
  // A batch's contents, their compressed form and their differences; and the last frame's streams,
  // which are kept with the beginnings of their chains.
  constexpr auto kBatchBytes = 4 * static_cast<int64_t>(NativeSequence::kBatchBytesMax);
  constexpr auto kKeptBytes = static_cast<int64_t>(SequenceWriterOptions{}.kept_bytes_max);
  return std::min(4 * frame_bytes, kBatchBytes) + std::min(2 * frame_bytes, kKeptBytes) +
         threads() * kThreadBytes;
}

int64_t voxelize_bytes(const Engine& engine, const Scene& scene, const RequestOptions& options,
                       const Placed& placed) {
  const VoxelizeOptions& asked = options.voxelize;
  const OutputOptions& output = options.output;
  const WantedChannels channels = wanted_channels(scene, asked);
  const GridSize size = grid_size(engine, scene, options, placed);
  int64_t result = size.bytes;
  const bool keeps = asked.needs_whole_surface() || output.file_layout().kind != FileLayout::kTiles;
  if (!keeps) result = std::min(result, static_cast<int64_t>(kKeptTileBytesMax));
  result += result / 4;  // growing arrays reserve more than they use
  const int64_t records =
      channels.any()
          ? static_cast<int64_t>(scene.triangle_count()) * kRecordBytes + 4 * image_bytes(scene)
          : 0;
  const bool on_device =
      asked.pipeline == PipelineChoice::kCompute || asked.pipeline == PipelineChoice::kRaster;
  // Lists of triangles grow by doubling.
  return 2 * mesh_bytes(scene) + size.tree_bytes + records + result + threads() * kThreadBytes +
         2 * static_cast<int64_t>(GridFile::kPendingBytesMax) +
         (on_device ? kSoftwareDeviceBytes : 0) +
         encoded_bytes(placed.spec, written_voxels(engine, scene, options, size), channels.grid,
                       output);
}

int64_t selection_bytes(const TileSource& source, const TileSource& selected,
                        const OutputOptions& output) {
  // A tile, and the cells of it that are merged.
  const int64_t batch = std::max<int64_t>(8, 2 * threads());
  const int64_t tiles = 3 * batch * largest_tile_bytes(source);
  const Grid& grid = selected.grid();
  int64_t whole = 0, voxels = 0;
  for (size_t i = 0; i < selected.coords().size(); ++i) {
    const int64_t in_tile = tile_voxels_max(selected, i);
    voxels += output.file_layout().is_mesh() ? std::min(in_tile, kTileSurfaceVoxels) : in_tile;
  }
  if (output.file_layout().kind != FileLayout::kTiles) {
    whole = std::min<int64_t>(
        largest_tile_bytes(selected) * static_cast<int64_t>(selected.coords().size()),
        grid.spec.cell_count() * (1 + static_cast<int64_t>(attribute_bytes(grid.channels))));
  }
  const int64_t recolored = recolors(output) ? dither_bytes(voxels, output) : 0;
  return tiles + whole + recolored + morphology_bytes(source, output) + threads() * kThreadBytes +
         2 * static_cast<int64_t>(GridFile::kPendingBytesMax) +
         encoded_bytes(grid.spec, voxels, grid.channels, output);
}

int64_t image_bytes(Engine& engine, const TileSource& source, const RenderOptions& render) {
  const int64_t batch = std::max<int64_t>(8, 2 * threads());
  const auto limit = static_cast<int64_t>(engine.image_limits.bytes_max);
  int64_t all = 0;
  for (size_t i = 0; i < source.coords().size() && all < limit; ++i) {
    all += 4 * tile_bytes_max(source, i);  // its tables are less than three times as large
  }
  const auto by = engine.choose_renderer(render.renderer);
  // A software driver copies a table while it is uploaded; its shaders come on top.
  const auto table = static_cast<int64_t>(
      std::min(by ? by->renderer->table_bytes_max() : 0, engine.image_limits.bytes_max / 2));
  all = std::min(all, limit);
  return all + std::min(all, table) + 3 * batch * largest_tile_bytes(source) +
         int64_t{16} * render.width * render.height + kSoftwareDeviceBytes / 2;
}

void expect_bytes(TaskRun& run, int64_t more, int64_t device_bytes) {
  const int64_t now = resident_bytes();
  const int64_t before = run.meta.value("host_bytes_estimate", int64_t{0});
  add_meta(run, {{"host_bytes_estimate", std::max({before, peak_resident_bytes(), now + more})}});
  // The current size, not the peak, which may have been another task's.
  run.slice.expect(now + more, device_bytes);
}

}  // namespace voxeld
