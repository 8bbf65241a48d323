#include "server/voxel/gl/mask_bricks.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <vector>

#include "server/base/check.h"

namespace voxeld {
namespace {

static_assert(std::endian::native == std::endian::little, "bricks are words of 64 and of 32 bits");

constexpr size_t kBlockBricks = kTileMaskBricks / 64;
// Fewer blocks are done before another thread is awake.
constexpr size_t kBlockGrain = 4;

bool is_empty(const BrickMask& brick) {
  uint64_t any = 0;
  for (const uint64_t word : brick.words) any |= word;
  return any == 0;
}

}  // namespace

void MaskBricks::take(std::span<BrickMask> mask, uint64_t blocks, WorkerPool& pool,
                      SparseTile& tile) {
  VOXELD_CHECK(mask.size() == kTileMaskBricks, "a mask of another size");
  std::array<size_t, 64> numbers{};
  size_t block_count = 0;
  for (; blocks != 0; blocks &= blocks - 1) {
    numbers[block_count++] = static_cast<size_t>(std::countr_zero(blocks));
  }
  const size_t parts =
      std::clamp<size_t>(block_count / kBlockGrain, 1, static_cast<size_t>(pool.threads()));
  const auto bound = [&](size_t part) { return block_count * part / parts; };
  // Each part has the places of its blocks in found_, then in the tile.
  std::vector<size_t> counts(parts);
  pool.run(static_cast<int>(parts), [&](int worker) {
    const auto part = static_cast<size_t>(worker);
    uint32_t* const begin = found_.data() + bound(part) * kBlockBricks;
    uint32_t* next = begin;
    for (size_t i = bound(part); i < bound(part + 1); ++i) {
      const size_t first = numbers[i] * kBlockBricks;
      for (size_t brick = first; brick < first + kBlockBricks; ++brick) {
        // Without a branch: which bricks are occupied cannot be foreseen.
        *next = static_cast<uint32_t>(brick);
        next += is_empty(mask[brick]) ? 0 : 1;
      }
    }
    counts[part] = static_cast<size_t>(next - begin);
  });
  std::vector<size_t> places(parts);
  size_t total = tile.masks.size();
  for (size_t part = 0; part < parts; ++part) {
    places[part] = total;
    total += counts[part];
  }
  tile.brick_morton.resize(total);
  tile.masks.resize(total);
  pool.run(static_cast<int>(parts), [&](int worker) {
    const auto part = static_cast<size_t>(worker);
    const uint32_t* const begin = found_.data() + bound(part) * kBlockBricks;
    for (size_t i = 0; i < counts[part]; ++i) {
      tile.brick_morton[places[part] + i] = begin[i];
      tile.masks[places[part] + i] = mask[begin[i]];
      mask[begin[i]] = {};
    }
  });
}

}  // namespace voxeld
