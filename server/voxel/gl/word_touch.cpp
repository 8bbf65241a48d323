#include "server/voxel/gl/word_touch.h"

#include <algorithm>
#include <thread>

#include "server/voxel/parallel.h"
#include "server/voxel/tile_mask.h"

namespace voxeld {
namespace {

int thread_count() {
  return static_cast<int>(
      std::clamp<size_t>(std::thread::hardware_concurrency(), 1, kVoxelThreadsMax));
}

}  // namespace

Status WordTouch::begin_job() {
  if (!pool_) pool_.emplace(thread_count());
  VOXELD_TRY(gpu::ensure_mappable(mask_, *context_, kTileMaskBytes, "tile mask"));
  VOXELD_TRY(
      gpu::ensure_size(params_, *context_, sizeof(shared::VoxelizeParams), "voxelize parameters"));
  if (!is_clear_) mask_.clear(0, kTileMaskBytes);
  blocks_ = 0;
  return context_->check("clearing the tile mask");
}

Status WordTouch::sort(const SnappedMesh& mesh, const glm::ivec3& tile_coord,
                       const glm::ivec3& cell_max, std::span<const uint32_t> triangles) {
  cell_max_ = cell_max;
  small_.begin(mesh, tile_coord, cell_max, triangles, *pool_);
  blocks_ |= small_.blocks();
  if (small_.count() == 0) return {};
  const size_t bytes = small_.count() * sizeof(shared::SmallTriangle);
  VOXELD_TRY(gpu::ensure_mappable(triangles_, *context_, bytes, "small triangles"));
  VOXELD_ASSIGN(gpu::BufferMapping mapping, triangles_.map(0, bytes));
  small_.write(mapping.as<shared::SmallTriangle>(), *pool_);
  return mapping.unmap();
}

Status WordTouch::touch() {
  if (small_.count() == 0) return {};
  VOXELD_ASSIGN(const gpu::Program* program, shaders_->get({{"voxelize_words.comp"}}));
  shared::VoxelizeParams params;
  params.cell_max = {cell_max_.x, cell_max_.y, cell_max_.z, 0};
  params.item_count = static_cast<uint32_t>(small_.count());
  params_.upload(0, std::span<const shared::VoxelizeParams>(&params, 1));
  params_.bind_uniform(VOXELIZE_PARAMS);
  triangles_.bind_storage(VOXELIZE_SMALL);
  mask_.bind_storage(VOXELIZE_MASK);
  is_clear_ = false;
  program->use();
  const auto count = static_cast<int64_t>(small_.count());
  program->dispatch((count + VOXELIZE_GROUP_SIZE - 1) / VOXELIZE_GROUP_SIZE);
  return context_->check("finding touched words");
}

Status WordTouch::take_bricks(uint64_t more_blocks, SparseTile& tile) {
  const uint64_t blocks = std::exchange(blocks_, 0) | more_blocks;
  if (blocks == 0) return {};
  context_->gl().MemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT);
  VOXELD_ASSIGN(gpu::BufferMapping mapping, mask_.map(0, kTileMaskBytes));
  bricks_.take(mapping.as<BrickMask>(), blocks, *pool_, tile);
  VOXELD_TRY(mapping.unmap());
  is_clear_ = true;
  return {};
}

int64_t WordTouch::bytes() const {
  return static_cast<int64_t>(triangles_.size_bytes() + mask_.size_bytes() + params_.size_bytes());
}

int64_t WordTouch::bytes_max(size_t triangles) {
  return static_cast<int64_t>(kTileMaskBytes + triangles * sizeof(shared::SmallTriangle) +
                              sizeof(shared::VoxelizeParams));
}

}  // namespace voxeld
