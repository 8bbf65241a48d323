#include "server/voxel/gl/occupancy/batch_touch.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "server/voxel/gl/occupancy/touch_pass.h"
#include "server/voxel/tiles/tile_mask.h"

namespace voxeld {
namespace {

static_assert(BATCH_TILE_MASK_WORDS == kTileMaskWords);

constexpr size_t kItemBytes = 8;
// The smallest size of the lists. They grow to what a run needed.
constexpr size_t kListItemsMin = size_t{1} << 14;
constexpr size_t kSmallArguments = offsetof(shared::BatchCounts, small_x);
constexpr size_t kLargeArguments = offsetof(shared::BatchCounts, large_x);
// The leading part of BatchCounts that is reset for each window.
constexpr size_t kWindowCountBytes = offsetof(shared::BatchCounts, small_needed);

// The size of a list: a power of two, so that jobs with slightly different lists use the same
// buffers.
size_t list_items(size_t needed, size_t limit) {
  size_t items = kListItemsMin;
  while (items < needed) items *= 2;
  return std::min(items, limit);
}

}  // namespace

BatchTouch::BatchTouch(const gpu::Context& context, gpu::ShaderLibrary& shaders,
                       const GlTuning& tuning, const DispatchPace& pace)
    : context_(&context), shaders_(&shaders), tuning_(tuning), pace_(&pace), mesh_(context) {}

int64_t BatchTouch::storage_bytes() const {
  const int64_t limit = context_->info().ssbo_bytes_max;
  return std::min(limit, tuning_.storage_bytes.value_or(limit));
}

size_t BatchTouch::batch_tiles() const {
  const int64_t fit = context_->info().ssbo_bytes_max / static_cast<int64_t>(kTileMaskBytes);
  const size_t wanted = tuning_.batch_tiles.value_or(BATCH_SLOTS_MAX);
  return std::clamp<size_t>(std::min(static_cast<size_t>(fit), wanted), 1, BATCH_SLOTS_MAX);
}

Status BatchTouch::begin_job(const VoxelizePlan& plan) {
  rule_ = plan.options.rule;
  values_ = {};
  values_.dims = {plan.spec.dims.x, plan.spec.dims.y, plan.spec.dims.z, 0};
  if (counts_.id() == 0) {
    VOXELD_ASSIGN(counts_,
                  gpu::Buffer::create(*context_, sizeof(shared::BatchCounts), "batch counts"));
    VOXELD_ASSIGN(params_,
                  gpu::Buffer::create(*context_, sizeof(shared::BatchParams), "batch parameters"));
  }
  return mesh_.begin_job(plan.mesh, plan.mesh_key, plan.has_device_vertices, storage_bytes());
}

Result<BatchTouch::Programs> BatchTouch::programs() const {
  gpu::Defines wide, small = {{"TOUCH_INT", "int"}, {"TOUCH_INT3", "ivec3"}};
  if (!tuning_.has_int64(context_->info())) {
    wide.emplace_back("NO_INT64", "1");
    small.insert(small.begin(), {"NO_INT64", "1"});
  }
  gpu::Defines large = wide;
  large.insert(large.begin(), {"BATCH_OF_LARGE", "1"});
  for (const auto& define : touch_rule_defines(rule_)) {
    small.push_back(define);
    large.push_back(define);
  }
  Programs programs{};
  VOXELD_ASSIGN(programs.classify, shaders_->get({{"batch_classify.comp"}}, wide));
  VOXELD_ASSIGN(programs.small, shaders_->get({{"batch_touch.comp"}}, small));
  VOXELD_ASSIGN(programs.large, shaders_->get({{"batch_touch.comp"}}, large));
  return programs;
}

Status BatchTouch::run(std::span<const TileBin> bins, gpu::PassTimer& timer) {
  VOXELD_ASSIGN(const Programs made, programs());
  VOXELD_TRY(gpu::ensure_size(masks_, *context_, bins.size() * kTileMaskBytes, "tile masks"));
  values_.slot_count = static_cast<uint32_t>(bins.size());
  for (size_t slot = 0; slot < bins.size(); ++slot) {
    const glm::ivec3 cell = bins[slot].coord * limits::kTileSide;
    values_.tiles[slot] = {cell.x, cell.y, cell.z, 0};
  }
  const size_t limit = static_cast<size_t>(storage_bytes()) / kItemBytes;
  size_t pairs = 0;
  for (const TileBin& bin : bins) pairs += bin.triangles.size();
  size_t pairs_max = std::clamp<size_t>(pairs, 1, std::min(mesh_.pairs_max(), pace_->triangles()));
  size_t small_needed = pairs, large_needed = pairs;
  values_.dispatch_items =
      static_cast<uint32_t>(pace_->items(BATCH_BLOCK_COLUMNS * BATCH_BLOCK_COLUMNS));
  for (;;) {
    const size_t small = list_items(small_needed, limit), large = list_items(large_needed, limit);
    VOXELD_TRY(gpu::ensure_size(small_, *context_, small * kItemBytes, "small work items"));
    VOXELD_TRY(gpu::ensure_size(large_, *context_, large * kItemBytes, "large work items"));
    values_.small_capacity = static_cast<uint32_t>(small_.size_bytes() / kItemBytes);
    values_.large_capacity = static_cast<uint32_t>(large_.size_bytes() / kItemBytes);
    VOXELD_ASSIGN(const shared::BatchCounts counts, run_windows(bins, pairs_max, made, timer));
    item_count_ = counts.item_count;
    small_needed = counts.small_needed;
    large_needed = counts.large_needed;
    if (holds(counts)) return context_->check("finding touched cells");
    // Halving ends, because a pair has at most 1024 items, which every device can hold.
    if (std::max(small_needed, large_needed) > limit) pairs_max = (pairs_max + 1) / 2;
  }
}

bool BatchTouch::holds(const shared::BatchCounts& counts) const {
  return counts.small_needed <= values_.small_capacity &&
         counts.large_needed <= values_.large_capacity;
}

Result<shared::BatchCounts> BatchTouch::run_windows(std::span<const TileBin> bins, size_t pairs_max,
                                                    const Programs& programs,
                                                    gpu::PassTimer& timer) {
  shared::BatchCounts counts{};
  counts_.upload(0, std::span<const shared::BatchCounts>(&counts, 1));
  bool is_first = true;
  for (const PairWindow& window : cut_pairs(bins, pairs_max)) {
    if (!is_first) VOXELD_TRY(pace_->rest());
    VOXELD_TRY(run_window(window, is_first, programs, timer));
    is_first = false;
    counts_.read(0, std::span(&counts, 1));
    if (!holds(counts)) break;
    VOXELD_TRY(run_rest(small_, counts.small_count, *programs.small, "small", timer));
    VOXELD_TRY(run_rest(large_, counts.large_count, *programs.large, "large", timer));
  }
  context_->gl().MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  return counts;
}

Status BatchTouch::run_rest(const gpu::Buffer& items, size_t count, const gpu::Program& program,
                            std::string_view pass, gpu::PassTimer& timer) {
  const size_t step = values_.dispatch_items;
  for (size_t first = step; first < count; first += step) {
    VOXELD_TRY(pace_->rest());
    values_.item_first = static_cast<uint32_t>(first);
    params_.upload(0, std::span<const shared::BatchParams>(&values_, 1));
    items.bind_storage(BATCH_ITEMS);
    const gpu::PassTimer::Pass measured = timer.measure(pass);
    program.dispatch((static_cast<int64_t>(std::min(step, count - first)) + BATCH_GROUP_SIZE - 1) /
                     BATCH_GROUP_SIZE);
  }
  return {};
}

Status BatchTouch::run_window(const PairWindow& window, bool is_first, const Programs& programs,
                              gpu::PassTimer& timer) {
  VOXELD_TRY(mesh_.upload(window));
  const std::array<uint32_t, kWindowCountBytes / 4> reset = {0, 0, 1, 1, 0, 0, 1, 1};
  counts_.upload(0, std::span<const uint32_t>(reset));
  values_.item_first = 0;
  values_.group_count = static_cast<uint32_t>(mesh_.group_count());
  values_.clear_vectors =
      is_first ? values_.slot_count * static_cast<uint32_t>(kTileMaskBytes / 16) : 0;
  params_.upload(0, std::span<const shared::BatchParams>(&values_, 1));
  params_.bind_uniform(BATCH_PARAMS);
  mesh_.bind();
  masks_.bind_storage(BATCH_MASKS);
  small_.bind_storage(BATCH_SMALL);
  large_.bind_storage(BATCH_LARGE);
  counts_.bind_storage(BATCH_COUNTS);
  counts_.bind_indirect();
  const uint32_t clear_groups =
      (values_.clear_vectors + BATCH_CLEAR_VECTORS - 1) / BATCH_CLEAR_VECTORS;
  const gpu::GlApi& gl = context_->gl();
  {
    const gpu::PassTimer::Pass pass = timer.measure("classify");
    programs.classify->use();
    programs.classify->dispatch(std::max(values_.group_count, clear_groups));
  }
  gl.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_COMMAND_BARRIER_BIT);
  {
    const gpu::PassTimer::Pass pass = timer.measure("small");
    small_.bind_storage(BATCH_ITEMS);
    programs.small->dispatch_indirect(kSmallArguments);
  }
  // No barrier is needed between the two: the lists differ, and bits are set by atomics.
  {
    const gpu::PassTimer::Pass pass = timer.measure("large");
    large_.bind_storage(BATCH_ITEMS);
    programs.large->dispatch_indirect(kLargeArguments);
  }
  gl.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  return context_->check("finding touched cells of a batch");
}

int64_t BatchTouch::bytes() const {
  return mesh_.bytes() +
         static_cast<int64_t>(masks_.size_bytes() + small_.size_bytes() + large_.size_bytes() +
                              counts_.size_bytes() + params_.size_bytes());
}

int64_t BatchTouch::bytes_max(size_t vertices, size_t triangles, size_t tiles) const {
  const size_t pairs = std::min(triangles * tiles, mesh_.pairs_max());
  const auto limit = static_cast<size_t>(storage_bytes());
  const size_t mesh = std::min(vertices * 12, limit) + std::min(triangles * 16, limit);
  return static_cast<int64_t>(std::min(tiles, batch_tiles()) * kTileMaskBytes + mesh +
                              pairs * (4 + 8) + 2 * std::min(2 * pairs * kItemBytes, limit));
}

}  // namespace voxeld
