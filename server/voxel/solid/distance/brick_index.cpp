#include "server/voxel/solid/distance/brick_index.h"

#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

const BrickMask& full_mask() {
  static const BrickMask mask = [] {
    BrickMask full;
    full.words.fill(~uint64_t{0});
    return full;
  }();
  return mask;
}

}  // namespace

BrickIndex::BrickIndex(std::span<const SparseTile> tiles, const glm::ivec3& dims)
    : tile_dims_((dims + limits::kTileSide - 1) / limits::kTileSide) {
  slots_.resize(tile_number(tile_dims_ - 1) + 1);
  for (const SparseTile& tile : tiles) {
    if (tile.empty()) continue;
    cancel_point();
    auto& slots = slots_[tile_number({tile.coord[0], tile.coord[1], tile.coord[2]})];
    slots = std::make_unique<Slots>(kTileBrickCount);
    for (size_t i = 0; i < tile.masks.size(); ++i) (*slots)[tile.brick_morton[i]] = &tile.masks[i];
    for (const FullNode& node : tile.full) {
      for (uint32_t i = 0; i < node.brick_count(); ++i) {
        (*slots)[node.brick_morton + i] = &full_mask();
      }
    }
  }
}

const BrickMask* BrickIndex::find(const glm::ivec3& brick) const {
  if (brick.x < 0 || brick.y < 0 || brick.z < 0) return nullptr;
  const glm::ivec3 tile = brick / kTileBricks;
  if (tile.x >= tile_dims_.x || tile.y >= tile_dims_.y || tile.z >= tile_dims_.z) return nullptr;
  const auto& slots = slots_[tile_number(tile)];
  if (slots == nullptr) return nullptr;
  const glm::ivec3 at = brick - tile * kTileBricks;
  return (*slots)[morton_encode(static_cast<uint32_t>(at.x), static_cast<uint32_t>(at.y),
                                static_cast<uint32_t>(at.z))];
}

}  // namespace voxeld
