#include "server/voxel/voxelize_job.h"

#include <algorithm>

#include "server/base/stopwatch.h"
#include "server/voxel/compact.h"

namespace voxeld {
namespace {

// Columns to a side of a large triangle's work items on devices with thousands of lanes.
constexpr int kHardwareBlockColumns = 4;

}  // namespace

VoxelizerState::VoxelizerState(gpu::Context& gpu_context, gpu::ShaderLibrary& shaders)
    : context(&gpu_context),
      device(gpu_context),
      touch(device, shaders),
      attributes(device, shaders),
      host_bytes_max(default_host_bytes_max()),
      mask(kTileMaskWords),
      word_offsets(kTileMaskWords) {}

VoxelizeJob::VoxelizeJob(VoxelizerState& state, const Scene& scene, const VoxelizeOptions& options,
                         const TileProgress& progress, VoxelizeStats& stats)
    : state_(state),
      scene_(scene),
      options_(options),
      progress_(progress),
      stats_(stats),
      timer_(*state.context),
      channels_(wanted_channels(scene, options)) {}

Result<Grid> VoxelizeJob::run() {
  choose_pipeline();
  VOXELD_TRY(prepare());
  Stopwatch watch;
  const TileBins bins(mesh_, grid_.spec.tile_dims());
  note("bin", watch.lap());
  const auto total = static_cast<int64_t>(bins.bins().size());
  for (int64_t done = 0; done < total; ++done) {
    VOXELD_TRY(run_tile(bins.bins()[static_cast<size_t>(done)]));
    if (progress_ && !progress_(done + 1, total)) {
      return Error{ErrorCode::kCancelled, "the job was cancelled while it was voxelized", "", ""};
    }
  }
  for (const auto& [pass, ms] : timer_.results()) note(pass, ms);
  return std::move(grid_);
}

void VoxelizeJob::choose_pipeline() {
  stats_.pipeline =
      options_.pipeline == PipelineChoice::kRaster ? Pipeline::kRaster : Pipeline::kCompute;
  stats_.pipeline_reason = "asked for";
  if (options_.pipeline != PipelineChoice::kAuto) return;
  stats_.pipeline_reason =
      "compute: measured faster than raster on software drivers, and hardware for data centres has "
      "few units that rasterize";
}

Status VoxelizeJob::prepare() {
  Stopwatch watch;
  VOXELD_ASSIGN(const Placed placed, place_scene(scene_, options_));
  grid_.spec = placed.spec;
  grid_.has_color = channels_.color;
  grid_.has_normal = channels_.normal;
  world_from_file_ = placed.world_from_file;
  note("place", watch.lap());
  VOXELD_TRY(check_host_bytes(placed.spec, mesh_bytes(scene_), state_.host_bytes_max));
  VOXELD_ASSIGN(mesh_, snap_scene(scene_, placed.world_from_file, placed.spec));
  VOXELD_TRY(check_host_bytes(placed.spec,
                              mesh_bytes(scene_) + result_bytes(mesh_, placed.spec, channels_),
                              state_.host_bytes_max));
  stats_.triangles = static_cast<int64_t>(mesh_.triangles.size());
  note("snap", watch.lap());
  for (size_t part = 0; part < scene_.parts.size(); ++part) {
    const bool sampled = channels_.color && options_.color != ColorMode::kAxis;
    part_images_.push_back(sampled ? part_image(scene_, part) : -1);
  }
  if (!channels_.any()) return {};
  records_.emplace(scene_, mesh_, grid_.spec, world_from_file_, options_.color, channels_.summed,
                   state_.context->info().texture_side_max);
  VOXELD_TRY(state_.attributes.begin_job(scene_, *records_, channels_.summed));
  note("textures", watch.lap());
  return {};
}

// Fills the state's window with the triangles of the bin from `first` on, and uploads it.
Status VoxelizeJob::fill_and_upload(const TileBin& bin, size_t first, size_t& end) {
  Stopwatch watch;
  const ItemSizes sizes{state_.context->info().is_software ? VOXELIZE_BLOCK_COLUMNS
                                                           : kHardwareBlockColumns};
  size_t count = std::min(bin.triangles.size() - first, kWindowTrianglesMax);
  while (!fill_tile_window(mesh_, grid_.spec, bin.coord, bin.triangles.subspan(first, count),
                           part_images_, sizes, state_.window)) {
    count = (count + 1) / 2;
  }
  end = first + count;
  note("items", watch.lap());
  if (state_.window.items.empty()) return {};
  VOXELD_TRY(state_.device.upload_window(state_.window, stats_.pipeline == Pipeline::kCompute));
  note("upload", watch.lap());
  return {};
}

Status VoxelizeJob::touch_tile(const TileBin& bin, uint64_t& blocks, bool& is_one_window) {
  VOXELD_TRY(state_.device.begin_tile(tile_cell_max(grid_.spec, bin.coord)));
  blocks = 0;
  for (size_t first = 0, end = 0; first < bin.triangles.size(); first = end) {
    VOXELD_TRY(fill_and_upload(bin, first, end));
    is_one_window = first == 0 && end == bin.triangles.size();
    stats_.work_items += static_cast<int64_t>(state_.window.items.size());
    if (state_.window.items.empty()) continue;
    timer_.begin("occupancy");
    VOXELD_TRY(state_.device.clear_mask(state_.window.blocks));
    VOXELD_TRY(state_.touch.run(state_.window, stats_.pipeline));
    timer_.end();
    blocks |= state_.window.blocks;
  }
  return {};
}

Status VoxelizeJob::run_tile(const TileBin& bin) {
  uint64_t blocks = 0;
  bool is_one_window = false;
  VOXELD_TRY(touch_tile(bin, blocks, is_one_window));
  if (blocks == 0) return {};
  ++stats_.tiles;
  Stopwatch watch;
  state_.device.read_mask(blocks, state_.mask);
  note("read", watch.lap());
  SparseTile tile;
  tile.coord = {bin.coord.x, bin.coord.y, bin.coord.z};
  std::span<uint32_t> offsets;
  if (channels_.any()) offsets = state_.word_offsets;
  const uint64_t voxels = compact_mask(state_.mask, blocks, tile, offsets);
  note("compact", watch.lap());
  if (voxels > 0 && channels_.any()) {
    VOXELD_TRY(state_.attributes.begin_tile(state_.word_offsets, blocks));
    note("upload", watch.lap());
    VOXELD_TRY(sum_attributes(bin, voxels, is_one_window, tile));
  }
  stats_.device_bytes_peak =
      std::max(stats_.device_bytes_peak, state_.device.bytes() + state_.attributes.bytes());
  if (voxels > 0) grid_.tiles.push_back(std::move(tile));
  return {};
}

Status VoxelizeJob::sum_attributes(const TileBin& bin, size_t voxel_count, bool is_one_window,
                                   SparseTile& tile) {
  if (channels_.color) tile.color.resize(4 * voxel_count);
  if (channels_.normal) tile.normal.resize(3 * voxel_count);
  const ResolveOptions resolve = {channels_.summed, channels_.shaded, channels_.color,
                                  channels_.normal};
  const size_t step = state_.attributes.voxels_max();
  for (size_t first = 0; first < voxel_count; first += step) {
    timer_.begin("attributes");
    VOXELD_TRY(state_.attributes.begin_voxels(first, std::min(step, voxel_count - first)));
    timer_.end();
    VOXELD_TRY(sum_windows(bin, is_one_window));
    Stopwatch watch;
    state_.attributes.read(state_.sums, state_.carries);
    note("read", watch.lap());
    resolve_voxels(state_.sums, state_.carries, resolve, first, tile);
    note("resolve", watch.lap());
  }
  return {};
}

// `is_one_window`: the bin's only window is still uploaded.
Status VoxelizeJob::sum_windows(const TileBin& bin, bool is_one_window) {
  for (size_t first = 0, end = 0; first < bin.triangles.size(); first = end) {
    end = bin.triangles.size();
    if (!is_one_window) VOXELD_TRY(fill_and_upload(bin, first, end));
    if (state_.window.items.empty()) continue;
    Stopwatch watch;
    records_->fill(bin.triangles.subspan(first, end - first), state_.window, state_.words);
    note("records", watch.lap());
    timer_.begin("attributes");
    VOXELD_TRY(state_.attributes.run(state_.window, state_.words, stats_.pipeline));
    timer_.end();
  }
  return {};
}

}  // namespace voxeld
