#include "server/voxel/gl/occupancy/batch_octree.h"

#include <algorithm>
#include <span>

#include "server/base/check.h"
#include "shaders/shared/voxelize_batch.h"

namespace voxeld {
namespace {

// Initial size of the octree buffer. It grows to what a batch needs.
constexpr size_t kOctreeBytesMin = size_t{1} << 18;

}  // namespace

Result<std::vector<std::vector<uint8_t>>> BatchOctree::run(const gpu::Buffer& masks, size_t tiles,
                                                           bool has_attributes,
                                                           gpu::PassTimer& timer) {
  VOXELD_CHECK(tiles >= 1 && tiles <= BATCH_SLOTS_MAX, "a batch has 1 to BATCH_SLOTS_MAX tiles");
  const size_t bricks = tiles * BATCH_TILE_BRICKS;
  VOXELD_TRY(gpu::ensure_size(bricks_, *context_, bricks * 4, "octree bricks"));
  VOXELD_TRY(gpu::ensure_size(places_, *context_, bricks * 8, "octree places"));
  VOXELD_TRY(
      gpu::ensure_size(tiles_, *context_, tiles * sizeof(shared::OctreeTile), "octrees of tiles"));
  VOXELD_TRY(gpu::ensure_size(count_, *context_, 4, "octree bytes in all"));
  VOXELD_TRY(
      gpu::ensure_size(params_, *context_, sizeof(shared::BatchParams), "octree parameters"));
  uint32_t bytes = 0;
  do {
    VOXELD_TRY(
        gpu::ensure_size(octrees_, *context_, std::max<size_t>(bytes, kOctreeBytesMin), "octrees"));
    VOXELD_TRY(dispatch(masks, tiles, has_attributes, timer));
    count_.read(0, std::span(&bytes, 1));
  } while (bytes > octrees_.size_bytes());
  std::vector<shared::OctreeTile> places(tiles);
  tiles_.read(0, std::span(places));
  std::vector<uint8_t> all(bytes);
  octrees_.read(0, std::span(all));
  std::vector<std::vector<uint8_t>> octrees(tiles);
  for (size_t slot = 0; slot < tiles; ++slot) {
    const auto first = all.begin() + static_cast<std::ptrdiff_t>(places[slot].byte_first);
    octrees[slot].assign(first, first + static_cast<std::ptrdiff_t>(places[slot].byte_count));
  }
  VOXELD_TRY(context_->check("building octrees"));
  return octrees;
}

Status BatchOctree::dispatch(const gpu::Buffer& masks, size_t tiles, bool has_attributes,
                             gpu::PassTimer& timer) {
  VOXELD_ASSIGN(const gpu::Program* find, shaders_->get({{"octree_bricks.comp"}}));
  VOXELD_ASSIGN(const gpu::Program* levels, shaders_->get({{"octree_levels.comp"}}));
  VOXELD_ASSIGN(const gpu::Program* leaves, shaders_->get({{"octree_leaves.comp"}}));
  shared::BatchParams values{};
  values.slot_count = static_cast<uint32_t>(tiles);
  values.has_full_nodes = has_attributes ? 0 : 1;
  values.octree_words = static_cast<uint32_t>(octrees_.size_bytes() / 4);
  params_.upload(0, std::span<const shared::BatchParams>(&values, 1));
  params_.bind_uniform(BATCH_PARAMS);
  count_.clear(0, 4);
  octrees_.clear(0, octrees_.size_bytes() / 4 * 4);
  masks.bind_storage(BATCH_MASKS);
  bricks_.bind_storage(OCTREE_BRICKS);
  places_.bind_storage(OCTREE_PLACES);
  tiles_.bind_storage(OCTREE_TILES);
  octrees_.bind_storage(OCTREE_BYTES);
  count_.bind_storage(OCTREE_COUNT);
  const auto groups = static_cast<int64_t>(tiles) * (BATCH_TILE_BRICKS / BATCH_GROUP_SIZE);
  const gpu::GlApi& gl = context_->gl();
  {
    const gpu::PassTimer::Pass pass = timer.measure("octree");
    find->dispatch(groups);
    gl.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    levels->dispatch(static_cast<int64_t>(tiles));
    gl.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    leaves->dispatch(groups);
    gl.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  }
  return context_->check("building octrees");
}

}  // namespace voxeld
