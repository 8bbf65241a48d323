#include "server/voxel/gl/occupancy/word_touch.h"

#include <algorithm>

#include "server/base/parallel.h"
#include "server/voxel/tiles/tile_mask.h"

namespace voxeld {

Status WordTouch::begin_job() {
  VOXELD_TRY(gpu::ensure_mappable(masks_, *context_, kBatchTiles * kTileMaskBytes, "tile masks"));
  VOXELD_TRY(
      gpu::ensure_size(params_, *context_, sizeof(shared::VoxelizeParams), "voxelize parameters"));
  if (!is_clear_) masks_.clear(0, kBatchTiles * kTileMaskBytes);
  blocks_ = {};
  return context_->check("clearing the tile masks");
}

Status WordTouch::sort(const SnappedMesh& mesh, std::span<const TilePart> parts) {
  small_.begin(mesh, parts, team_);
  for (size_t slot = 0; slot < kBatchTiles; ++slot) blocks_[slot] |= small_.blocks(slot);
  if (small_.count() == 0) return {};
  const size_t bytes = small_.count() * sizeof(shared::SmallTriangle);
  VOXELD_TRY(gpu::ensure_mappable(triangles_, *context_, bytes, "small triangles"));
  VOXELD_ASSIGN(gpu::BufferMapping mapping, triangles_.map(0, bytes));
  small_.write(mapping.as<shared::SmallTriangle>(), team_);
  return mapping.unmap();
}

Status WordTouch::touch() {
  if (small_.count() == 0) return {};
  VOXELD_ASSIGN(const gpu::Program* program, shaders_->get({{"voxelize_words.comp"}}));
  shared::VoxelizeParams params;
  params.item_count = static_cast<uint32_t>(small_.count());
  params_.upload(0, std::span<const shared::VoxelizeParams>(&params, 1));
  params_.bind_uniform(VOXELIZE_PARAMS);
  triangles_.bind_storage(VOXELIZE_SMALL);
  masks_.bind_storage(VOXELIZE_MASK);
  is_clear_ = false;
  program->use();
  const auto count = static_cast<int64_t>(small_.count());
  program->dispatch((count + VOXELIZE_GROUP_SIZE - 1) / VOXELIZE_GROUP_SIZE);
  return context_->check("finding touched words");
}

Status WordTouch::take_bricks(std::span<const uint64_t> more_blocks, std::span<SparseTile> tiles) {
  auto blocks = std::exchange(blocks_, {});
  uint64_t any = 0;
  for (size_t slot = 0; slot < more_blocks.size(); ++slot) any |= blocks[slot] |= more_blocks[slot];
  if (any == 0) return {};
  context_->gl().MemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT);
  VOXELD_ASSIGN(gpu::BufferMapping mapping, masks_.map(0, tiles.size() * kTileMaskBytes));
  bricks_.take(mapping.as<BrickMask>(), std::span(blocks).first(tiles.size()), team_, tiles);
  VOXELD_TRY(mapping.unmap());
  is_clear_ = true;
  return {};
}

int64_t WordTouch::bytes() const {
  return static_cast<int64_t>(triangles_.size_bytes() + masks_.size_bytes() + params_.size_bytes());
}

int64_t WordTouch::bytes_max(size_t triangles) {
  return static_cast<int64_t>(kBatchTiles * kTileMaskBytes +
                              triangles * sizeof(shared::SmallTriangle) +
                              sizeof(shared::VoxelizeParams));
}

}  // namespace voxeld
