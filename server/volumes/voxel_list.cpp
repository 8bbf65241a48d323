#include "server/volumes/voxel_list.h"

#include <algorithm>
#include <span>
#include <utility>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/base/raw_vector.h"

namespace voxeld::volumes {
namespace {

constexpr uint32_t kListOctantSide = limits::kTileSide / 2;
constexpr uint32_t kListCodeShift = 32;  // of a voxel's Morton code in its entry
constexpr uint32_t kListDigitBits = 11;  // two digits are the code of a cell in an octant
static_assert(kListOctantSide * kListOctantSide * kListOctantSide <= 1u << 2 * kListDigitBits);

// Below this number a comparison sort is faster than clearing the counters of the digits.
constexpr size_t kListRadixSortMin = 4096;
constexpr size_t kListCancelVoxels = size_t{1} << 18;

uint64_t list_code(uint64_t voxel) {
  return voxel >> kListCodeShift;
}

// One stable pass of a radix sort, by the digit at bit `shift` of the code.
void sort_list_by_digit(std::span<const uint64_t> from, uint64_t* to, uint32_t shift) {
  constexpr size_t kDigits = size_t{1} << kListDigitBits;
  const auto digit = [&](uint64_t voxel) {
    return static_cast<size_t>(voxel >> (kListCodeShift + shift)) & (kDigits - 1);
  };
  std::vector<size_t> next(kDigits);
  for (const uint64_t voxel : from) ++next[digit(voxel)];
  size_t begin = 0;
  for (size_t& place : next) begin += std::exchange(place, begin);
  for (const uint64_t voxel : from) to[next[digit(voxel)]++] = voxel;
}

}  // namespace

uint32_t VoxelList::add_values(const VoxelValues& values) {
  values_.push_back(values);
  return static_cast<uint32_t>(values_.size() - 1);
}

void VoxelList::add(const std::array<int32_t, 3>& cell, uint32_t values) {
  const auto x = static_cast<uint32_t>(cell[0]), y = static_cast<uint32_t>(cell[1]),
             z = static_cast<uint32_t>(cell[2]);
  const uint32_t order =
      morton_encode(x / kListOctantSide, y / kListOctantSide, z / kListOctantSide);
  if (octants_.empty() || octants_[last_].order != order) {
    const auto [known, is_new] = octant_of_.try_emplace(order, octants_.size());
    if (is_new) octants_.push_back({order, {}});
    last_ = known->second;
  }
  constexpr uint32_t kMask = limits::kTileSide - 1;
  const uint64_t code = morton_encode(x & kMask, y & kMask, z & kMask);
  octants_[last_].voxels.push_back(code << kListCodeShift | values);
  ++size_;
}

// Sorts by code and keeps the order of voxels with equal codes.
void VoxelList::sort(std::vector<uint64_t>& voxels) {
  if (std::ranges::is_sorted(voxels, {}, list_code)) return;
  if (voxels.size() < kListRadixSortMin) {
    std::ranges::stable_sort(voxels, {}, list_code);
    return;
  }
  RawVector<uint64_t> other(voxels.size());
  sort_list_by_digit(voxels, other.data(), 0);
  sort_list_by_digit(other, voxels.data(), kListDigitBits);
}

SparseTile VoxelList::tile_of(std::span<const Octant> octants, const ChannelSet& channels) const {
  const auto tile = morton_decode(octants.front().order >> 3);
  TileAppender appender(
      {static_cast<int32_t>(tile[0]), static_cast<int32_t>(tile[1]), static_cast<int32_t>(tile[2])},
      channels);
  uint64_t last_code = UINT64_MAX;
  for (const Octant& octant : octants) {
    for (size_t i = 0; i < octant.voxels.size(); ++i) {
      if (i % kListCancelVoxels == 0) cancel_point();
      const uint64_t code = list_code(octant.voxels[i]);
      if (code == last_code) continue;
      last_code = code;
      appender.add(static_cast<uint32_t>(code), values_[static_cast<uint32_t>(octant.voxels[i])]);
    }
  }
  return appender.finish();
}

std::vector<SparseTile> VoxelList::finish(const ChannelSet& channels) {
  std::ranges::sort(octants_, {}, &Octant::order);
  // cancel_point() acts on the calling thread, which shares the loops; the pool skips the rest.
  ThreadPool::shared().for_each(octants_.size(), [&](size_t i) {
    cancel_point();
    sort(octants_[i].voxels);
  });
  std::vector<std::span<Octant>> tiles;  // the octants of each tile
  for (size_t begin = 0, end = 0; begin < octants_.size(); begin = end) {
    const uint32_t order = octants_[begin].order >> 3;
    while (end < octants_.size() && octants_[end].order >> 3 == order) ++end;
    tiles.push_back(std::span(octants_).subspan(begin, end - begin));
  }
  std::vector<SparseTile> made(tiles.size());
  ThreadPool::shared().for_each(tiles.size(), [&](size_t i) {
    made[i] = tile_of(tiles[i], channels);
    for (Octant& octant : tiles[i]) octant.voxels = {};
  });
  *this = {};
  return made;
}

}  // namespace voxeld::volumes
