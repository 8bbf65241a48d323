#include "server/voxel/gl/small_triangles.h"

#include <algorithm>
#include <utility>

#include <glm/common.hpp>

#include "proto/limits.h"
#include "proto/sparse_tile.h"
#include "server/base/check.h"

namespace voxeld {
namespace {

// Fewer triangles are done before another thread is awake.
constexpr size_t kTriangleGrain = 1024;

// Words of the mask along x, y and z of a block of 64^3 cells, as shifts.
constexpr glm::ivec3 kBlockOfWord = {4, 4, 5};
constexpr glm::ivec3 kWordOfCell = {2, 2, 1};

uint32_t low_and_high(int low, int high) {
  return static_cast<uint32_t>(low) | static_cast<uint32_t>(high) << 16;
}

uint32_t block_number(const glm::ivec3& block) {
  return morton_encode(static_cast<uint32_t>(block.x), static_cast<uint32_t>(block.y),
                       static_cast<uint32_t>(block.z));
}

// Between words, both included.
uint64_t blocks_between(const glm::ivec3& first_word, const glm::ivec3& last_word) {
  const glm::ivec3 first = first_word >> kBlockOfWord, last = last_word >> kBlockOfWord;
  if (first == last) return uint64_t{1} << block_number(first);
  uint64_t blocks = 0;
  glm::ivec3 block;
  for (block.z = first.z; block.z <= last.z; ++block.z) {
    for (block.y = first.y; block.y <= last.y; ++block.y) {
      for (block.x = first.x; block.x <= last.x; ++block.x) {
        blocks |= uint64_t{1} << block_number(block);
      }
    }
  }
  return blocks;
}

// Corners in the tile's coordinates; box: its first cell; words: first and last one.
shared::SmallTriangle pack(const glm::ivec3& a, const glm::ivec3& b, const glm::ivec3& c,
                           const glm::ivec3& box, const glm::ivec3& first_word,
                           const glm::ivec3& last_word) {
  const glm::ivec3 origin = box * kSubVoxelsPerVoxel;
  const glm::ivec3 p = a - origin, q = b - origin, r = c - origin, cell = box + VOXELIZE_SMALL_BIAS,
                   more = last_word - first_word;
  const int place =
      cell.x | cell.y << VOXELIZE_SMALL_CELL_BITS | cell.z << (2 * VOXELIZE_SMALL_CELL_BITS);
  const int words = first_word.x | first_word.y << VOXELIZE_SMALL_WORD_Y_SHIFT |
                    first_word.z << VOXELIZE_SMALL_WORD_Z_SHIFT |
                    more.x << VOXELIZE_SMALL_COUNT_X_SHIFT |
                    more.y << VOXELIZE_SMALL_COUNT_Y_SHIFT | more.z << VOXELIZE_SMALL_COUNT_Z_SHIFT;
  return {
      {low_and_high(p.x, q.x), low_and_high(p.y, q.y), low_and_high(p.z, q.z),
       low_and_high(r.x, r.y)},
      {static_cast<uint32_t>(r.z), static_cast<uint32_t>(place), static_cast<uint32_t>(words), 0}};
}

}  // namespace

void SmallTriangles::begin(const SnappedMesh& mesh, const glm::ivec3& tile_coord,
                           const glm::ivec3& cell_max, std::span<const uint32_t> triangles,
                           WorkerPool& pool) {
  chunk_count_ =
      std::clamp<size_t>(triangles.size() / kTriangleGrain, 1, static_cast<size_t>(pool.threads()));
  chunks_.resize(std::max(chunks_.size(), chunk_count_));
  const glm::ivec3 tile_q = tile_coord * (limits::kTileSide * kSubVoxelsPerVoxel);
  pool.run(static_cast<int>(chunk_count_), [&](int part) {
    const auto i = static_cast<size_t>(part);
    const size_t first = triangles.size() * i / chunk_count_;
    const size_t last = triangles.size() * (i + 1) / chunk_count_;
    sort_chunk(mesh, tile_q, cell_max, triangles.subspan(first, last - first), chunks_[i]);
  });
  count_ = 0;
  blocks_ = 0;
  large_.clear();
  for (size_t i = 0; i < chunk_count_; ++i) {
    blocks_ |= chunks_[i].blocks;
    large_.insert(large_.end(), chunks_[i].large.begin(), chunks_[i].large.end());
  }
  for (size_t key = 0; key < kWordsMax; ++key) {
    for (size_t i = 0; i < chunk_count_; ++i) {
      count_ += std::exchange(chunks_[i].places[key], count_);
    }
  }
}

void SmallTriangles::sort_chunk(const SnappedMesh& mesh, const glm::ivec3& tile_q,
                                const glm::ivec3& cell_max, std::span<const uint32_t> triangles,
                                Chunk& chunk) {
  chunk.packed.resize(triangles.size());
  chunk.large.clear();
  chunk.blocks = 0;
  std::ranges::fill(chunk.places, 0u);
  Packed* next = chunk.packed.data();
  for (const uint32_t number : triangles) {
    const auto& corners = mesh.triangles[number].vertices;
    const glm::ivec3 a = mesh.vertices[corners[0]] - tile_q, b = mesh.vertices[corners[1]] - tile_q,
                     c = mesh.vertices[corners[2]] - tile_q;
    const glm::ivec3 low = glm::min(a, glm::min(b, c)), high = glm::max(a, glm::max(b, c));
    const glm::ivec3 box = low >> limits::kSubVoxelBits, extent = high - low;
    const glm::ivec3 first = glm::max(box, glm::ivec3(0)),
                     last = glm::min(high >> limits::kSubVoxelBits, cell_max);
    if (first.x > last.x || first.y > last.y || first.z > last.z) continue;
    if (std::max(extent.x, std::max(extent.y, extent.z)) > VOXELIZE_SMALL_EXTENT) {
      chunk.large.push_back(number);
      continue;
    }
    const glm::ivec3 first_word = first >> kWordOfCell, last_word = last >> kWordOfCell,
                     words = last_word - first_word + 1;
    chunk.blocks |= blocks_between(first_word, last_word);
    next->triangle = pack(a, b, c, box, first_word, last_word);
    next->key = std::min(static_cast<uint32_t>(words.x * words.y * words.z),
                         static_cast<uint32_t>(kWordsMax)) -
                1;
    ++chunk.places[next->key];
    ++next;
  }
  chunk.packed.resize(static_cast<size_t>(next - chunk.packed.data()));
}

void SmallTriangles::write(std::span<shared::SmallTriangle> out, WorkerPool& pool) {
  VOXELD_CHECK(out.size() == count_, "a place for each small triangle");
  pool.run(static_cast<int>(chunk_count_), [&](int part) {
    Chunk& chunk = chunks_[static_cast<size_t>(part)];
    for (const Packed& packed : chunk.packed) {
      out[chunk.places[packed.key]++] = packed.triangle;
    }
  });
}

}  // namespace voxeld
