#include "server/voxel/gl/occupancy/small_triangles.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "proto/limits.h"
#include "server/base/check.h"

namespace voxeld {
namespace {

// Fewer triangles are done before another thread has woken up.
constexpr size_t kTriangleGrain = 1024;

// x, y, z and an unused lane. GCC and Clang have this vector on every machine.
using Int4 = int32_t __attribute__((vector_size(16)));

static_assert(sizeof(Int4) == sizeof(shared::uvec4));

// Shifts from cells to words of the mask, and from words to blocks of 64^3 cells.
constexpr Int4 kWordOfCell = {2, 2, 1, 0}, kBlockOfWord = {4, 4, 5, 0};

Int4 lesser(Int4 a, Int4 b) {
  return a < b ? a : b;
}
Int4 greater(Int4 a, Int4 b) {
  return a > b ? a : b;
}
bool any_negative(Int4 v) {
  return (v[0] | v[1] | v[2]) < 0;
}
bool is_same(Int4 a, Int4 b) {
  const Int4 differs = a ^ b;
  return (differs[0] | differs[1] | differs[2]) == 0;
}
Int4 to_int4(const glm::ivec3& v) {
  return Int4{v.x, v.y, v.z, 0};
}
shared::uvec4 to_uvec4(Int4 v) {
  shared::uvec4 words;
  std::memcpy(static_cast<void*>(&words), &v, sizeof words);
  return words;
}

// The bit of a block of the tile.
uint64_t block_bit(int32_t x, int32_t y, int32_t z) {
  constexpr std::array<uint8_t, 4> kSpread = {0, 1, 8, 9};
  return uint64_t{1} << (kSpread[static_cast<size_t>(x)] | kSpread[static_cast<size_t>(y)] << 1 |
                         kSpread[static_cast<size_t>(z)] << 2);
}

// The blocks between two words, both included.
uint64_t blocks_between(Int4 first_word, Int4 last_word) {
  const Int4 first = first_word >> kBlockOfWord, last = last_word >> kBlockOfWord;
  if (is_same(first, last)) return block_bit(first[0], first[1], first[2]);
  uint64_t blocks = 0;
  for (int32_t z = first[2]; z <= last[2]; ++z) {
    for (int32_t y = first[1]; y <= last[1]; ++y) {
      for (int32_t x = first[0]; x <= last[0]; ++x) blocks |= block_bit(x, y, z);
    }
  }
  return blocks;
}

// The words of the mask that a box reaches: the first, and how many more on each axis.
struct WordBox {
  Int4 first, more;
};

// Packs a triangle. Corners are in the tile's coordinates; box: its first cell.
shared::SmallTriangle pack(Int4 a, Int4 b, Int4 c, Int4 box, const WordBox& words, Int4 cell_last,
                           uint32_t slot) {
  const Int4 origin = box << limits::kSubVoxelBits, r = c - origin;
  Int4 corners = (a - origin) | (b - origin) << 16;
  corners[3] = r[0] | r[1] << 16;
  constexpr int32_t kY = VOXELIZE_SMALL_CELL_BITS, kZ = 2 * VOXELIZE_SMALL_CELL_BITS;
  const Int4 cell = (box + VOXELIZE_SMALL_BIAS) << Int4{0, kY, kZ, 0};
  const Int4 reached =
      words.first << Int4{0, VOXELIZE_SMALL_WORD_Y_SHIFT, VOXELIZE_SMALL_WORD_Z_SHIFT, 0} |
      words.more << Int4{VOXELIZE_SMALL_COUNT_X_SHIFT, VOXELIZE_SMALL_COUNT_Y_SHIFT,
                         VOXELIZE_SMALL_COUNT_Z_SHIFT, 0};
  constexpr int32_t kLast = VOXELIZE_SMALL_LAST_BITS;
  const Int4 last = lesser(cell_last - box, Int4{} + VOXELIZE_SMALL_LAST_MAX)
                    << Int4{0, kLast, 2 * kLast, 0};
  const Int4 place = {r[2], cell[0] | cell[1] | cell[2], reached[0] | reached[1] | reached[2],
                      static_cast<int32_t>(slot) | (last[0] | last[1] | last[2])
                                                       << VOXELIZE_SMALL_SLOT_BITS};
  return {to_uvec4(corners), to_uvec4(place)};
}

// Calls visit(part) for each part's share of triangles [first, last), numbered across all parts.
template <typename Visit>
void for_each_part_between(std::span<const TilePart> parts, size_t first, size_t last,
                           Visit&& visit) {
  size_t begin = 0;
  for (TilePart part : parts) {
    const size_t end = begin + part.triangles.size();
    const size_t from = std::max(first, begin), to = std::min(last, end);
    if (from < to) {
      part.triangles = part.triangles.subspan(from - begin, to - from);
      visit(part);
    }
    begin = end;
  }
}

}  // namespace

void SmallTriangles::begin(const SnappedMesh& mesh, std::span<const TilePart> parts,
                           ThreadTeam& team) {
  size_t total = 0;
  for (const TilePart& part : parts) total += part.triangles.size();
  chunk_count_ = std::clamp<size_t>(total / kTriangleGrain, 1, static_cast<size_t>(team.threads()));
  chunks_.resize(std::max(chunks_.size(), chunk_count_));
  team.run(static_cast<int>(chunk_count_), [&](int worker) {
    const auto i = static_cast<size_t>(worker);
    const size_t first = total * i / chunk_count_, last = total * (i + 1) / chunk_count_;
    Chunk& chunk = chunks_[i];
    chunk.packed.resize(last - first);
    chunk.packed_count = 0;
    for (std::vector<uint32_t>& large : chunk.large) large.clear();
    chunk.blocks = {};
    std::ranges::fill(chunk.places, 0u);
    for_each_part_between(parts, first, last,
                          [&](const TilePart& part) { sort_part(mesh, part, chunk); });
  });
  count_ = 0;
  for (size_t slot = 0; slot < kSlotsMax; ++slot) {
    blocks_[slot] = 0;
    large_[slot].clear();
    for (size_t i = 0; i < chunk_count_; ++i) {
      const Chunk& chunk = chunks_[i];
      blocks_[slot] |= chunk.blocks[slot];
      large_[slot].insert(large_[slot].end(), chunk.large[slot].begin(), chunk.large[slot].end());
    }
  }
  for (size_t key = 0; key < size_t{kWordsMax}; ++key) {
    for (size_t i = 0; i < chunk_count_; ++i) {
      count_ += std::exchange(chunks_[i].places[key], count_);
    }
  }
}

void SmallTriangles::sort_part(const SnappedMesh& mesh, const TilePart& part, Chunk& chunk) {
  Packed* next = chunk.packed.data() + chunk.packed_count;
  const Int4 origin = to_int4(part.coord * (limits::kTileSide * kSubVoxelsPerVoxel)),
             cell_last = to_int4(part.cell_max);
  uint64_t blocks = 0;
  for (const uint32_t number : part.triangles) {
    const auto& corners = mesh.triangles[number].vertices;
    const Int4 a = to_int4(mesh.vertices[corners[0]]) - origin,
               b = to_int4(mesh.vertices[corners[1]]) - origin,
               c = to_int4(mesh.vertices[corners[2]]) - origin;
    const Int4 low = lesser(a, lesser(b, c)), high = greater(a, greater(b, c));
    const Int4 box = low >> limits::kSubVoxelBits;
    const Int4 first = greater(box, Int4{}),
               last = lesser(high >> limits::kSubVoxelBits, cell_last);
    if (any_negative(last - first)) continue;
    if (any_negative(VOXELIZE_SMALL_EXTENT - (high - low))) {
      chunk.large[part.slot].push_back(number);
      continue;
    }
    const Int4 first_word = first >> kWordOfCell, last_word = last >> kWordOfCell,
               more = last_word - first_word;
    blocks |= blocks_between(first_word, last_word);
    next->triangle = pack(a, b, c, box, {first_word, more}, cell_last, part.slot);
    next->key = static_cast<uint32_t>(
        std::min((more[0] + 1) * (more[1] + 1) * (more[2] + 1), kWordsMax) - 1);
    ++chunk.places[next->key];
    ++next;
  }
  chunk.blocks[part.slot] |= blocks;
  chunk.packed_count = static_cast<size_t>(next - chunk.packed.data());
}

void SmallTriangles::write(std::span<shared::SmallTriangle> out, ThreadTeam& team) {
  VOXELD_CHECK(out.size() == count_, "a place for each small triangle");
  team.run(static_cast<int>(chunk_count_), [&](int part) {
    Chunk& chunk = chunks_[static_cast<size_t>(part)];
    for (const Packed& packed : std::span(chunk.packed).first(chunk.packed_count)) {
      out[chunk.places[packed.key]++] = packed.triangle;
    }
  });
}

}  // namespace voxeld
