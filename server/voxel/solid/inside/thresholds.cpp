#include "server/voxel/solid/inside/thresholds.h"

#include "server/base/cancel_point.h"

namespace voxeld {

void Thresholds::begin_tile(const WindingField* field, const glm::ivec3& first) {
  field_ = field;
  first_ = first;
  any_ = field != nullptr && !field->empty() && field->threshold(first, limits::kTileSide) != 1;
  blocks_.fill(kUnknown);
}

int Thresholds::of_brick(int x, int y, int z) {
  if (!any_) return 1;
  const int block_x = x / kBlockBricks, block_y = y / kBlockBricks, block_z = z / kBlockBricks;
  const auto row = static_cast<size_t>(block_z) * kBlocks + static_cast<size_t>(block_y);
  int& block = blocks_[row * kBlocks + static_cast<size_t>(block_x)];
  constexpr int kBlockSide = kBlockBricks * limits::kBrickSide;
  if (block == kUnknown) {
    block =
        field_->threshold(first_ + glm::ivec3(block_x, block_y, block_z) * kBlockSide, kBlockSide)
            .value_or(kMixed);
  }
  if (block != kMixed) return block;
  const glm::ivec3 first = first_ + glm::ivec3(x, y, z) * limits::kBrickSide;
  return field_->threshold(first, limits::kBrickSide).value_or(kMixed);
}

void Thresholds::of_cells(int x, int y, int z, std::array<int, 512>& thresholds) const {
  const glm::ivec3 first = first_ + glm::ivec3(x, y, z) * limits::kBrickSide;
  for (int i = 0; i < 8; ++i) {
    add_cells(first + glm::ivec3(i & 1, i >> 1 & 1, i >> 2) * 4, 4, first, thresholds);
  }
}

// Halves cubes until each has a single threshold or is one cell.
void Thresholds::add_cells(const glm::ivec3& first, int side, const glm::ivec3& brick_first,
                           std::array<int, 512>& thresholds) const {
  cancel_point();
  const std::optional<int> one =
      side == 1 ? std::optional(field_->threshold(first)) : field_->threshold(first, side);
  if (!one) {
    for (int i = 0; i < 8; ++i) {
      add_cells(first + glm::ivec3(i & 1, i >> 1 & 1, i >> 2) * (side / 2), side / 2, brick_first,
                thresholds);
    }
    return;
  }
  const glm::ivec3 at = first - brick_first;
  for (int z = at.z; z < at.z + side; ++z) {
    for (int y = at.y; y < at.y + side; ++y) {
      const size_t row = static_cast<size_t>(z) * 8 + static_cast<size_t>(y);
      for (int x = at.x; x < at.x + side; ++x) {
        thresholds[row * 8 + static_cast<size_t>(x)] = *one;
      }
    }
  }
}

}  // namespace voxeld
