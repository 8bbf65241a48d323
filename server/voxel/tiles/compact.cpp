#include "server/voxel/tiles/compact.h"

#include <algorithm>
#include <bit>

#include "server/voxel/tiles/tile_mask.h"

namespace voxeld {
namespace {

constexpr size_t kBrickWords = 16;

uint64_t word_pair(const uint32_t* words) {
  return uint64_t{words[0]} | uint64_t{words[1]} << 32;
}

}  // namespace

uint64_t compact_mask(std::span<const uint32_t> mask, uint64_t blocks, SparseTile& tile,
                      std::span<uint32_t> word_offsets) {
  uint64_t voxels = 0;
  for_each_block_run(blocks, [&](size_t first_word, size_t word_count) {
    for (size_t at = first_word; at < first_word + word_count; at += kBrickWords) {
      BrickMask brick;
      uint64_t any = 0;
      for (size_t w = 0; w < brick.words.size(); ++w) {
        brick.words[w] = word_pair(&mask[at + 2 * w]);
        any |= brick.words[w];
      }
      if (any == 0) continue;
      tile.brick_morton.push_back(static_cast<uint32_t>(at / kBrickWords));
      tile.masks.push_back(brick);
      for (size_t w = 0; w < kBrickWords; ++w) {
        if (!word_offsets.empty()) word_offsets[at + w] = static_cast<uint32_t>(voxels);
        voxels += static_cast<uint64_t>(std::popcount(mask[at + w]));
      }
    }
  });
  return voxels;
}

void expand_mask(const SparseTile& tile, std::span<uint32_t> mask) {
  std::ranges::fill(mask, 0u);
  for (size_t b = 0; b < tile.masks.size(); ++b) {
    uint32_t* words = &mask[size_t{tile.brick_morton[b]} * kBrickWords];
    for (const uint64_t pair : tile.masks[b].words) {
      *words++ = static_cast<uint32_t>(pair);
      *words++ = static_cast<uint32_t>(pair >> 32);
    }
  }
}

uint64_t number_words(const SparseTile& tile, std::span<uint32_t> word_offsets, uint64_t& blocks) {
  uint64_t voxels = 0;
  blocks = 0;
  for (size_t b = 0; b < tile.masks.size(); ++b) {
    const size_t first = size_t{tile.brick_morton[b]} * kBrickWords;
    blocks |= uint64_t{1} << (first / kBlockMaskWords);
    for (size_t w = 0; w < kBrickWords; ++w) {
      const auto word = static_cast<uint32_t>(tile.masks[b].words[w / 2] >> (32 * (w % 2)));
      word_offsets[first + w] = static_cast<uint32_t>(voxels);
      voxels += static_cast<uint64_t>(std::popcount(word));
    }
  }
  return voxels;
}

}  // namespace voxeld
