#include "server/voxel/gl/occupancy/batch_bricks.h"

#include <algorithm>
#include <bit>

#include "shaders/shared/voxelize_batch.h"

namespace voxeld {
namespace {

static_assert(std::endian::native == std::endian::little,
              "masks are copied as words of the device");
static_assert(sizeof(BrickMask) == 64);

// Initial capacity of the buffers in bricks, 1 MiB. They grow to what a batch needs.
constexpr size_t kBricksMin = size_t{1} << 14;

}  // namespace

Result<std::vector<SparseTile>> BatchBricks::run(const gpu::Buffer& masks,
                                                 const gpu::Buffer& counts,
                                                 std::span<const TileBin> bins,
                                                 gpu::PassTimer& timer) {
  const size_t words = bins.size() * BATCH_TILE_BRICK_WORDS * 4;
  VOXELD_TRY(gpu::ensure_size(bits_, *context_, words, "brick bits"));
  VOXELD_TRY(gpu::ensure_size(ranks_, *context_, words, "brick ranks"));
  VOXELD_TRY(gpu::ensure_size(tiles_, *context_, bins.size() * sizeof(shared::BatchTile),
                              "bricks of tiles"));
  VOXELD_TRY(gpu::ensure_size(params_, *context_, sizeof(shared::BatchParams), "brick parameters"));
  VOXELD_ASSIGN(const gpu::Program* find, shaders_->get({{"batch_bricks.comp"}}));
  VOXELD_ASSIGN(const gpu::Program* scan, shaders_->get({{"batch_scan.comp"}}));
  shared::BatchParams values{};
  values.slot_count = static_cast<uint32_t>(bins.size());
  params_.upload(0, std::span<const shared::BatchParams>(&values, 1));
  params_.bind_uniform(BATCH_PARAMS);
  masks.bind_storage(BATCH_MASKS);
  counts.bind_storage(BATCH_COUNTS);
  bits_.bind_storage(BATCH_BRICK_BITS);
  ranks_.bind_storage(BATCH_BRICK_RANKS);
  tiles_.bind_storage(BATCH_TILES);
  const auto groups = static_cast<int64_t>(bins.size()) * (BATCH_TILE_BRICKS / BATCH_GROUP_SIZE);
  {
    const gpu::PassTimer::Pass pass = timer.measure("bricks");
    find->use();
    find->dispatch(groups);
    context_->gl().MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    scan->use();
    scan->dispatch(static_cast<int64_t>(bins.size()));
    context_->gl().MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  }
  // The last batch's capacity mostly suffices. Then the gather need not wait for the counts.
  VOXELD_TRY(gather(std::max(capacity_, kBricksMin), groups, timer));
  std::vector<shared::BatchTile> found(bins.size());
  tiles_.read(0, std::span(found));
  size_t total = 0;
  for (const shared::BatchTile& tile : found) total += tile.brick_count;
  if (total > capacity_) VOXELD_TRY(gather(total, groups, timer));
  std::vector<uint32_t> mortons(total);
  std::vector<BrickMask> bricks(total);
  mortons_.read(0, std::span(mortons));
  bricks_.read(0, std::span(bricks));
  VOXELD_TRY(context_->check("gathering bricks"));
  std::vector<SparseTile> tiles(bins.size());
  for (size_t slot = 0; slot < bins.size(); ++slot) {
    const auto first = static_cast<std::ptrdiff_t>(found[slot].brick_first);
    const auto end = first + static_cast<std::ptrdiff_t>(found[slot].brick_count);
    tiles[slot].coord = {bins[slot].coord.x, bins[slot].coord.y, bins[slot].coord.z};
    tiles[slot].brick_morton.assign(mortons.begin() + first, mortons.begin() + end);
    tiles[slot].masks.assign(bricks.begin() + first, bricks.begin() + end);
  }
  return tiles;
}

// Gathers into buffers with room for `bricks`.
Status BatchBricks::gather(size_t bricks, int64_t groups, gpu::PassTimer& timer) {
  VOXELD_ASSIGN(const gpu::Program* program, shaders_->get({{"batch_gather.comp"}}));
  VOXELD_TRY(gpu::ensure_size(mortons_, *context_, bricks * 4, "brick places"));
  VOXELD_TRY(gpu::ensure_size(bricks_, *context_, bricks * sizeof(BrickMask), "bricks"));
  capacity_ = bricks;
  const auto capacity = static_cast<uint32_t>(capacity_);
  params_.upload(offsetof(shared::BatchParams, brick_capacity),
                 std::span<const uint32_t>(&capacity, 1));
  mortons_.bind_storage(BATCH_MORTONS);
  bricks_.bind_storage(BATCH_BRICKS);
  {
    const gpu::PassTimer::Pass pass = timer.measure("gather");
    program->use();
    program->dispatch(groups);
  }
  context_->gl().MemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  return {};
}

int64_t BatchBricks::bytes_max(size_t tiles) {
  return static_cast<int64_t>(
      tiles * (BATCH_TILE_BRICKS * (4 + sizeof(BrickMask)) + size_t{BATCH_TILE_BRICK_WORDS} * 8));
}

int64_t BatchBricks::bytes() const {
  return static_cast<int64_t>(bits_.size_bytes() + ranks_.size_bytes() + tiles_.size_bytes() +
                              mortons_.size_bytes() + bricks_.size_bytes() + params_.size_bytes());
}

}  // namespace voxeld
