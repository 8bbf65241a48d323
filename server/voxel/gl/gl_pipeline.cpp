#include "server/voxel/gl/gl_pipeline.h"

#include <algorithm>
#include <array>
#include <iterator>

#include "server/base/clock.h"
#include "server/voxel/attributes/sum_fold.h"
#include "server/voxel/estimates/calibration.h"
#include "server/voxel/tiles/compact.h"
#include "server/voxel/tiles/tile_mask.h"
#include "shaders/shared/attributes.h"

namespace voxeld {

GlPipeline::GlPipeline(gpu::Context& context, gpu::ShaderLibrary& shaders, const GlTuning& tuning)
    : context_(&context),
      tuning_(tuning),
      pace_(context, tuning.dispatch_columns),
      device_(context, pace_),
      touch_(device_, shaders, tuning.has_int64(context.info())),
      word_touch_(context, shaders),
      attributes_(device_, shaders),
      batch_touch_(context, shaders, tuning, pace_),
      batch_bricks_(context, shaders),
      inside_(context, shaders),
      flood_(context, shaders),
      skin_(context, shaders),
      mask_(kTileMaskWords),
      word_offsets_(kTileMaskWords) {}

Status GlPipeline::begin_job(const VoxelizePlan& plan, VoxelizeStats& stats) {
  plan_ = &plan;
  stats_ = &stats;
  if (plan.channels.any() && !tuning_.has_int64(context_->info())) {
    return Error{ErrorCode::kUnsupportedFeature,
                 "attributes need 64-bit integers in shaders, which " + context_->info().renderer +
                     " does not have",
                 "pipeline=cpu or auto, or channels=occupancy",
                 "pipeline " + std::string(pipeline_name(stats.pipeline))};
  }
  const bool has_attributes = plan.channels.any();
  pace_.begin_job(
      plan.calibration ? plan.calibration->model(stats.pipeline, has_attributes) : nullptr,
      stats.work, has_attributes);
  timer_.emplace(*context_);
  Stopwatch watch;
  if (is_batched()) {
    VOXELD_TRY(batch_touch_.begin_job(plan));
    note("upload", watch.lap());
  }
  if (is_by_words()) VOXELD_TRY(word_touch_.begin_job());
  if (!plan.records) return {};
  VOXELD_TRY(
      attributes_.begin_job(plan.scene, *plan.records, plan.channels.summed, plan.textures_key));
  note("textures", watch.lap());
  return {};
}

Status GlPipeline::run_tiles(std::span<const TileBin> bins, const Pause& pause,
                             std::vector<SparseTile>& tiles) {
  struct PauseScope {  // ends with run_tiles(), by an exception too
    DispatchPace& pace;
    ~PauseScope() { pace.set_pause(nullptr); }
  };
  const PauseScope scope{pace_};
  pace_.set_pause(&pause);
  return run_bins(bins, tiles);
}

Status GlPipeline::run_bins(std::span<const TileBin> bins, std::vector<SparseTile>& tiles) {
  if (is_batched()) return run_batch(bins, tiles);
  if (is_by_words()) return run_words(bins, tiles);
  for (const TileBin& bin : bins) VOXELD_TRY(run_tile(bin, tiles));
  return {};
}

bool GlPipeline::is_batched() const {
  return stats_->pipeline == Pipeline::kCompute && plan_->options.rule != Rule::kNone &&
         tuning_.wants_batches(context_->info());
}

bool GlPipeline::is_by_words() const {
  return stats_->pipeline == Pipeline::kCompute && plan_->options.rule == Rule::kTouch &&
         !plan_->channels.any() && !is_batched();
}

size_t GlPipeline::batch_tiles() const {
  if (stats_ == nullptr) return 1;
  return is_batched() ? batch_touch_.batch_tiles() : is_by_words() ? WordTouch::kBatchTiles : 1;
}

void GlPipeline::end_job() {
  if (timer_) {
    for (const auto& [pass, ms] : timer_->results()) note(pass, ms);
    timer_.reset();
    if (is_batched()) stats_->mesh_bytes_uploaded += batch_touch_.uploaded_bytes();
  }
  attributes_.end_job();
  batch_touch_.end_job();
  plan_ = nullptr;
  stats_ = nullptr;
}

void GlPipeline::end_frames() {
  attributes_.end_frames();
  batch_touch_.end_frames();
  skin_.end_frames();
  skinned_ = nullptr;
}

Result<bool> GlPipeline::can_skin(const SkinnedFrames& frames) {
  const int64_t storage_bytes = batch_touch_.storage_bytes();
  if (frames.pipeline != Pipeline::kCompute || frames.rule == Rule::kNone ||
      !tuning_.wants_batches(context_->info()) || !tuning_.has_float64(context_->info()) ||
      !ResidentMesh::fits(frames.table.vertex_count(), frames.triangle_count, storage_bytes) ||
      !SkinPass::fits(frames.table, storage_bytes)) {
    return false;
  }
  return skin_.is_exact();
}

Result<bool> GlPipeline::skin(const SkinFrame& frame, VoxelizeStats& stats) {
  VOXELD_TRY(skin_.begin_frames(frame.table, frame.key));
  VOXELD_ASSIGN(skinned_, batch_touch_.vertices(frame.table.vertex_count()));
  gpu::PassTimer timer(*context_);
  VOXELD_ASSIGN(const bool stands_in_cells, skin_.run(frame, *skinned_, timer));
  for (const auto& [pass, ms] : timer.results()) add_stage(stats.passes, pass, ms);
  stats.mesh_bytes_uploaded += skin_.uploaded_bytes();
  return stands_in_cells;
}

void GlPipeline::read_vertices(std::span<glm::ivec3> q) const {
  if (skinned_ != nullptr) skinned_->read(0, q);
}

void GlPipeline::read_positions(size_t first, std::span<glm::dvec3> positions) const {
  skin_.read_positions(first, positions);
}

int64_t GlPipeline::device_bytes(const Scene& scene, const WantedChannels& channels) const {
  const auto triangles =
      static_cast<int64_t>(std::min(scene.triangle_count(), kWindowTrianglesMax));
  int64_t bytes = static_cast<int64_t>(kTileMaskBytes) + triangles * 9 * 4 +
                  static_cast<int64_t>(kWindowItemsMax * sizeof(WorkItemWords));
  if (tuning_.wants_batches(context_->info())) {
    bytes += batch_touch_.bytes_max(scene.vertex_count(), scene.triangle_count(),
                                    batch_touch_.batch_tiles()) +
             batch_bricks_.bytes_max(batch_touch_.batch_tiles());
  } else {
    bytes += WordTouch::bytes_max(static_cast<size_t>(triangles));
  }
  if (channels.any()) {
    bytes += static_cast<int64_t>(kTileMaskBytes) + triangles * ATTRIBUTE_WORDS * 4 +
             2 * std::min(static_cast<int64_t>(kSumsBytesMax), context_->info().ssbo_bytes_max);
  }
  return bytes;
}

DeviceTraits GlPipeline::traits() const {
  return {context_->info().is_software, context_->info().texture_side_max,
          tuning_.has_int64(context_->info())};
}

Status GlPipeline::find_inside(const InsideJob& job, const ColumnProgress& progress,
                               std::vector<SparseTile>& tiles, AxisVotes& votes,
                               VoxelizeStats& stats) {
  return inside_.run(job, progress, device_.bytes() + attributes_.bytes(), tiles, votes, stats);
}

Result<bool> GlPipeline::flood_inside(std::span<const SparseTile> touched, const glm::ivec3& dims,
                                      const ColumnProgress& progress,
                                      std::vector<SparseTile>& tiles, VoxelizeStats& stats) {
  return flood_.run(touched, dims, progress, device_.bytes() + attributes_.bytes(), tiles, stats);
}

int64_t GlPipeline::inside_bytes(const glm::ivec3& dims, Sign sign) const {
  if (sign == Sign::kFlood) return flood_.bytes(dims);
  return GlInside::bytes_max(dims, sign);
}

// Fills the window with triangles of the bin, from `first` up to `end`, and uploads it.
Status GlPipeline::fill_and_upload(const TileBin& bin, size_t first, size_t& end) {
  Stopwatch watch;
  const ItemSizes sizes{context_->info().is_software ? VOXELIZE_BLOCK_COLUMNS
                                                     : kHardwareBlockColumns};
  size_t count = std::min(bin.triangles.size() - first, kWindowTrianglesMax);
  while (!fill_tile_window(plan_->mesh, plan_->spec, bin.coord, bin.triangles.subspan(first, count),
                           plan_->part_images, sizes, window_)) {
    count = (count + 1) / 2;
  }
  end = first + count;
  note("items", watch.lap());
  if (window_.items.empty()) return {};
  VOXELD_TRY(device_.upload_window(window_, stats_->pipeline == Pipeline::kCompute));
  note("upload", watch.lap());
  return {};
}

// Touches all windows of a begun tile and adds their blocks to `blocks`.
Status GlPipeline::touch_windows(const TileBin& bin, uint64_t& blocks, bool& is_one_window) {
  for (size_t first = 0, end = 0; first < bin.triangles.size(); first = end) {
    VOXELD_TRY(fill_and_upload(bin, first, end));
    is_one_window = first == 0 && end == bin.triangles.size();
    stats_->work_items += static_cast<int64_t>(window_.items.size());
    if (window_.items.empty()) continue;
    {
      const gpu::PassTimer::Pass pass = timer_->measure("occupancy");
      VOXELD_TRY(device_.clear_mask(window_.blocks));
      VOXELD_TRY(touch_.run(window_, stats_->pipeline, plan_->options.rule));
    }
    blocks |= window_.blocks;
  }
  return {};
}

Status GlPipeline::run_words(std::span<const TileBin> bins, std::vector<SparseTile>& tiles) {
  std::array<uint64_t, WordTouch::kBatchTiles> blocks{};
  std::vector<TilePart> parts;
  size_t triangles = 0;
  for (size_t slot = 0; slot < bins.size(); ++slot) {
    const TileBin& bin = bins[slot];
    for (size_t first = 0; first < bin.triangles.size();) {
      const size_t count = std::min(bin.triangles.size() - first, kWindowTrianglesMax - triangles);
      parts.push_back({static_cast<uint32_t>(slot), bin.coord,
                       tile_cell_max(plan_->spec, bin.coord), bin.triangles.subspan(first, count)});
      first += count;
      triangles += count;
      if (triangles < kWindowTrianglesMax) continue;
      VOXELD_TRY(touch_words(parts, blocks));
      parts.clear();
      triangles = 0;
    }
  }
  if (!parts.empty()) VOXELD_TRY(touch_words(parts, blocks));
  std::vector<SparseTile> found(bins.size());
  Stopwatch watch;
  VOXELD_TRY(word_touch_.take_bricks(std::span(blocks).first(bins.size()), found));
  note("compact", watch.lap());
  stats_->tiles += static_cast<int64_t>(bins.size());
  stats_->device_bytes_peak =
      std::max(stats_->device_bytes_peak, device_.bytes() + word_touch_.bytes());
  for (size_t slot = 0; slot < bins.size(); ++slot) {
    const glm::ivec3& coord = bins[slot].coord;
    found[slot].coord = {coord.x, coord.y, coord.z};
    if (!found[slot].masks.empty()) tiles.push_back(std::move(found[slot]));
  }
  return {};
}

// Runs a batch. Adds to the slots' blocks those that large triangles may touch.
Status GlPipeline::touch_words(std::span<const TilePart> parts, std::span<uint64_t> blocks) {
  Stopwatch watch;
  VOXELD_TRY(word_touch_.sort(plan_->mesh, parts));
  note("items", watch.lap());
  {
    const gpu::PassTimer::Pass pass = timer_->measure("occupancy");
    VOXELD_TRY(word_touch_.touch());
  }
  stats_->work_items += static_cast<int64_t>(word_touch_.small_count());
  for (const TilePart& part : parts) {
    const auto large = word_touch_.large(part.slot);
    if (large.empty()) continue;
    VOXELD_TRY(device_.begin_tile(part.cell_max));
    device_.use_mask(word_touch_.masks(), part.slot * kTileMaskBytes);
    bool is_one_window = false;
    VOXELD_TRY(touch_windows({part.coord, large}, blocks[part.slot], is_one_window));
  }
  return {};
}

Status GlPipeline::run_tile(const TileBin& bin, std::vector<SparseTile>& tiles) {
  uint64_t blocks = 0;
  bool is_one_window = false;
  VOXELD_TRY(device_.begin_tile(tile_cell_max(plan_->spec, bin.coord)));
  VOXELD_TRY(touch_windows(bin, blocks, is_one_window));
  if (blocks == 0) return {};
  ++stats_->tiles;
  Stopwatch watch;
  device_.read_mask(blocks, mask_);
  note("read", watch.lap());
  SparseTile tile;
  tile.coord = {bin.coord.x, bin.coord.y, bin.coord.z};
  std::span<uint32_t> offsets;
  if (plan_->channels.any()) offsets = word_offsets_;
  const uint64_t voxels = compact_mask(mask_, blocks, tile, offsets);
  note("compact", watch.lap());
  if (voxels > 0 && plan_->channels.any()) {
    VOXELD_TRY(attributes_.begin_tile(word_offsets_, blocks));
    note("upload", watch.lap());
    VOXELD_TRY(sum_attributes(bin, voxels, is_one_window, tile));
  }
  stats_->device_bytes_peak =
      std::max(stats_->device_bytes_peak, device_.bytes() + attributes_.bytes());
  if (voxels > 0) tiles.push_back(std::move(tile));
  return {};
}

// Device times of the passes come from the timer. "read" is the wait for them and the copy.
Status GlPipeline::run_batch(std::span<const TileBin> bins, std::vector<SparseTile>& tiles) {
  VOXELD_TRY(batch_touch_.run(bins, *timer_));
  Stopwatch watch;
  VOXELD_ASSIGN(std::vector<SparseTile> found,
                batch_bricks_.run(batch_touch_.masks(), batch_touch_.counts(), bins, *timer_));
  note("read", watch.lap());
  stats_->tiles += static_cast<int64_t>(bins.size());
  stats_->work_items += batch_touch_.item_count();
  for (size_t slot = 0; slot < bins.size(); ++slot) {
    if (found[slot].empty()) continue;
    if (plan_->channels.any()) VOXELD_TRY(add_attributes(bins[slot], slot, found[slot]));
    tiles.push_back(std::move(found[slot]));
  }
  stats_->device_bytes_peak = std::max(
      stats_->device_bytes_peak, device_.bytes() + attributes_.bytes() + batch_touch_.bytes() +
                                     batch_bricks_.bytes() + skin_.bytes());
  return {};
}

// Adds attributes to a tile whose mask is still on the device.
Status GlPipeline::add_attributes(const TileBin& bin, size_t slot, SparseTile& tile) {
  Stopwatch watch;
  uint64_t blocks = 0;
  const uint64_t voxels = number_words(tile, word_offsets_, blocks);
  VOXELD_TRY(device_.begin_tile(tile_cell_max(plan_->spec, bin.coord)));
  device_.use_mask(batch_touch_.masks(), slot * kTileMaskBytes);
  VOXELD_TRY(attributes_.begin_tile(word_offsets_, blocks));
  note("upload", watch.lap());
  return sum_attributes(bin, voxels, false, tile);
}

Status GlPipeline::sum_attributes(const TileBin& bin, size_t voxel_count, bool is_one_window,
                                  SparseTile& tile) {
  resize_channels(tile, plan_->channels.grid);
  const size_t step = attributes_.voxels_max();
  for (size_t first = 0; first < voxel_count; first += step) {
    const size_t count = std::min(step, voxel_count - first);
    if (plan_->needs_sums()) VOXELD_TRY(resolve_sums(bin, first, count, is_one_window, tile));
    for (const IdChannel& channel : plan_->ids) {
      if (channel.is_wide) continue;
      VOXELD_TRY(fold_ids(bin, channel, first, count, tile));
      is_one_window = false;  // fold_ids() has uploaded another window
    }
  }
  return {};
}

Status GlPipeline::resolve_sums(const TileBin& bin, size_t first, size_t count, bool is_one_window,
                                SparseTile& tile) {
  {
    const gpu::PassTimer::Pass pass = timer_->measure("attributes");
    VOXELD_TRY(attributes_.begin_voxels(first, count));
  }
  VOXELD_TRY(sum_windows(bin, is_one_window));
  Stopwatch watch;
  attributes_.read(sums_, carries_);
  note("read", watch.lap());
  resolve_voxels(sums_, carries_, plan_->resolve_options(), first, tile);
  note("resolve", watch.lap());
  return {};
}

Status GlPipeline::fold_ids(const TileBin& bin, const IdChannel& channel, size_t first,
                            size_t count, SparseTile& tile) {
  const auto ids = distinct_ids(channel, plan_->mesh, bin.triangles);
  const bool is_color = channel.channel == Channel::kColor;
  if (ids.size() == 1) {
    if (is_color) return {};  // resolved from the sums of all ids
    const auto samples = std::span(id_samples(tile, channel.channel)).subspan(first, count);
    std::ranges::fill(samples, ids.front());
    return {};
  }
  const AttributeChannels channels = is_color ? plan_->channels.summed : AttributeChannels();
  attributes_.set_channels(channels);
  SumFold sums(is_color ? count : 0, channels);
  fold_.begin(is_color ? 0 : count);
  for (const uint16_t id : ids) {
    VOXELD_TRY(sum_alone(bin, channel, id, first, count));
    Stopwatch watch;
    const auto sum_at = [&](size_t at) {
      return sums_[at] | (carries_.empty() ? 0u : uint64_t{carries_[at]} << 32);
    };
    if (is_color) {
      sums.add(sum_at);
    } else {
      fold_.add(id, sum_at, std::span(id_samples(tile, channel.channel)).subspan(first, count));
    }
    note("ids", watch.lap());
  }
  attributes_.set_channels(plan_->channels.summed);
  if (is_color) {
    resolve_voxels(sums.sums(), dominant_part(plan_->resolve_options()), first, tile);
  }
  return {};
}

// Sums only the triangles with one id.
Status GlPipeline::sum_alone(const TileBin& bin, const IdChannel& channel, uint16_t id,
                             size_t first, size_t count) {
  std::vector<uint32_t> triangles;
  std::ranges::copy_if(bin.triangles, std::back_inserter(triangles), [&](uint32_t triangle) {
    return channel.id_of(plan_->mesh, triangle) == id;
  });
  VOXELD_TRY(attributes_.begin_voxels(first, count));
  VOXELD_TRY(sum_windows({bin.coord, triangles}, false));
  attributes_.read(sums_, carries_);
  return {};
}

// is_one_window: the bin's only window is still uploaded, so it need not be filled again.
Status GlPipeline::sum_windows(const TileBin& bin, bool is_one_window) {
  for (size_t first = 0, end = 0; first < bin.triangles.size(); first = end) {
    end = bin.triangles.size();
    if (!is_one_window) VOXELD_TRY(fill_and_upload(bin, first, end));
    if (window_.items.empty()) continue;
    Stopwatch watch;
    plan_->records->fill(bin.triangles.subspan(first, end - first), window_, words_);
    note("records", watch.lap());
    const gpu::PassTimer::Pass pass = timer_->measure("attributes");
    VOXELD_TRY(attributes_.run(window_, words_, stats_->pipeline));
  }
  return {};
}

}  // namespace voxeld
