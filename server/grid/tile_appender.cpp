#include "server/grid/tile_appender.h"

#include <algorithm>
#include <utility>

#include "proto/codec/canonical_tile.h"

namespace voxeld {
namespace {

constexpr uint32_t kBrickCodeBits = 9;  // bits of a cell's code in its brick
constexpr size_t kBrickVoxels = size_t{1} << kBrickCodeBits;

}  // namespace

VoxelValues values_of(const SparseTile& tile, size_t index) {
  VoxelValues values;
  if (index == kNoAttributes) return values;
  if (!tile.color.empty()) {
    std::copy_n(&tile.color[4 * index], values.color.size(), values.color.begin());
  }
  if (!tile.normal.empty()) {
    std::copy_n(&tile.normal[3 * index], values.normal.size(), values.normal.begin());
  }
  if (!tile.material.empty()) values.material = tile.material[index];
  if (!tile.label.empty()) values.label = tile.label[index];
  if (!tile.distance.empty()) values.distance = tile.distance[index];
  if (!tile.coverage.empty()) values.coverage = tile.coverage[index];
  return values;
}

TileAppender::TileAppender(const std::array<int32_t, 3>& coord, const ChannelSet& channels)
    : channels_(channels) {
  tile_.coord = coord;
}

void TileAppender::add(uint32_t code, const VoxelValues& values) {
  const uint32_t brick = code >> kBrickCodeBits;
  if (!has_brick_ || brick != brick_) {
    close_brick();
    has_brick_ = true;
    brick_ = brick;
  }
  const uint32_t bit = code & (kBrickVoxels - 1);
  mask_.words[bit / 64] |= uint64_t{1} << (bit % 64);
  has_values_ = has_values_ || !values.none();
  if (channels_.color) {
    tile_.color.insert(tile_.color.end(), values.color.begin(), values.color.end());
  }
  if (channels_.normal) {
    tile_.normal.insert(tile_.normal.end(), values.normal.begin(), values.normal.end());
  }
  if (channels_.material) tile_.material.push_back(values.material);
  if (channels_.label) tile_.label.push_back(values.label);
  if (channels_.distance) tile_.distance.push_back(values.distance);
  if (channels_.coverage) tile_.coverage.push_back(values.coverage);
}

void TileAppender::close_brick() {
  if (!has_brick_) return;
  if (is_full(mask_) && !has_values_) {
    for_each_channel(tile_, [&](Channel channel, auto& samples) {
      if (samples.empty()) return;
      samples.resize(samples.size() - channel_info(channel).components * kBrickVoxels);
    });
    tile_.full.push_back({brick_, 0});
  } else {
    tile_.brick_morton.push_back(brick_);
    tile_.masks.push_back(mask_);
  }
  mask_ = {};
  has_values_ = false;
}

SparseTile TileAppender::finish() {
  close_brick();
  has_brick_ = false;
  canonicalize(tile_);
  return std::move(tile_);
}

}  // namespace voxeld
