#include "server/worker/grids/host_estimate.h"

#include <algorithm>
#include <optional>
#include <thread>

#include "proto/limits.h"
#include "server/formats/native_sequence.h"
#include "server/formats/npy_array.h"
#include "server/process/machine.h"
#include "server/worker/grids/grid_file.h"

namespace voxeld {
namespace {

constexpr int64_t kMebi = int64_t{1} << 20;
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

// The file that is made from a whole grid, and what the encoder holds beside it.
int64_t encoded_bytes(int64_t cells, int64_t voxels, const ChannelSet& channels,
                      const OutputOptions& output) {
  const FileLayout layout = format_info(output.format).layout;
  if (layout.kind == FileLayout::kTiles) return 0;
  if (layout.kind == FileLayout::kPoints) return 2 * voxels * layout.point_bytes;
  const auto cell_bytes = [&](std::optional<Channel> channel) {
    const NpyType type = npy_type(channel, output);
    return static_cast<int64_t>(type.sample_bytes * type.components);
  };
  int64_t bytes = cell_bytes(std::nullopt);
  for (const ChannelInfo& info : kChannels) {
    const bool is_written = layout.kind == FileLayout::kDenseChannels && channels.has(info.channel);
    if (is_written) bytes += cell_bytes(info.channel);
  }
  return 2 * cells * bytes;
}

int64_t tile_voxels_max(const TileSource& source, size_t index) {
  const auto known = static_cast<int64_t>(source.voxels(index));
  return known > 0 ? known : kTileCells;
}

// Upper bound of one decoded tile: one brick per voxel, and attributes.
int64_t tile_bytes_max(const TileSource& source, size_t index) {
  constexpr int64_t kBrickCells =
      int64_t{limits::kBrickSide} * limits::kBrickSide * limits::kBrickSide;
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
};

GridSize grid_size(const Engine& engine, const Scene& scene, const RequestOptions& options,
                   const Placed& placed) {
  const VoxelizeOptions& asked = options.voxelize;
  const GridSize dense = {dense_result_bytes(placed.spec, wanted_channels(scene, asked)),
                          placed.spec.cell_count()};
  if (asked.fill == Fill::kSurface && dense.bytes <= kDenseBytesMin) return dense;
  const auto closer = engine.voxelizer.estimate(scene, asked);
  if (!closer) return dense;
  return {std::min(dense.bytes, closer->host_bytes), std::min(dense.voxels, closer->voxels)};
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
  const bool fills = asked.fill != Fill::kSurface;
  const GridSize size = grid_size(engine, scene, options, placed);
  int64_t result = size.bytes;
  const bool keeps = fills || format_info(output.format).layout.kind != FileLayout::kTiles;
  if (!keeps) result = std::min(result, static_cast<int64_t>(kKeptTileBytesMax));
  result += result / 4;  // growing arrays reserve more than they use
  const int64_t records =
      channels.any()
          ? static_cast<int64_t>(scene.triangle_count()) * kRecordBytes + 4 * image_bytes(scene)
          : 0;
  const bool on_device =
      asked.pipeline == PipelineChoice::kCompute || asked.pipeline == PipelineChoice::kRaster;
  // Lists of triangles grow by doubling.
  return 2 * mesh_bytes(scene) + records + result + threads() * kThreadBytes +
         2 * static_cast<int64_t>(GridFile::kPendingBytesMax) +
         (on_device ? kSoftwareDeviceBytes : 0) +
         encoded_bytes(placed.spec.cell_count(), size.voxels, channels.grid, output);
}

int64_t selection_bytes(const TileSource& source, const TileSource& selected,
                        const OutputOptions& output) {
  // A tile, and the cells of it that are merged.
  const int64_t batch = std::max<int64_t>(8, 2 * threads());
  const int64_t tiles = 3 * batch * largest_tile_bytes(source);
  const Grid& grid = selected.grid();
  int64_t whole = 0, voxels = 0;
  for (size_t i = 0; i < selected.coords().size(); ++i) {
    voxels += tile_voxels_max(selected, i);
  }
  if (format_info(output.format).layout.kind != FileLayout::kTiles) {
    whole = std::min<int64_t>(
        largest_tile_bytes(selected) * static_cast<int64_t>(selected.coords().size()),
        grid.spec.cell_count() * (1 + static_cast<int64_t>(attribute_bytes(grid.channels))));
  }
  return tiles + whole + threads() * kThreadBytes +
         2 * static_cast<int64_t>(GridFile::kPendingBytesMax) +
         encoded_bytes(grid.spec.cell_count(), voxels, grid.channels, output);
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
  add_meta(run, {{"host_bytes_estimate", std::max(peak_resident_bytes(), now + more)}});
  // The current size, not the peak, which may have been another task's.
  run.slice.expect(now + more, device_bytes);
}

}  // namespace voxeld
