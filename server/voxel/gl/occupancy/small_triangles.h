// The triangles of some tiles, prepared for pass voxelize_words. Those at most 16 voxels wide are
// packed into two vectors each. They are sorted by the number of mask words that their boxes reach,
// so that the lanes of a SIMD group have equal work.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "server/base/parallel.h"
#include "server/base/raw_vector.h"
#include "server/voxel/triangles/snap.h"
#include "shaders/shared/voxelize.h"

namespace voxeld {

// The triangles of one tile.
struct TilePart {
  uint32_t slot = 0;                    // slot of the tile's mask, below SmallTriangles::kSlotsMax
  glm::ivec3 coord{0}, cell_max{0};     // in tiles; tile_cell_max()
  std::span<const uint32_t> triangles;  // numbers in the mesh
};

// Packs and sorts triangles. It keeps its memory between calls. Not thread-safe.
class SmallTriangles {
 public:
  static constexpr size_t kSlotsMax = 8;

  // Takes the triangles of at most kSlotsMax tiles, each in a slot of its own.
  void begin(const SnappedMesh& mesh, std::span<const TilePart> parts, ThreadTeam& team);

  // Number of small triangles of the last begin(). Triangles whose boxes miss the tile's cells are
  // neither small nor large.
  size_t count() const { return count_; }
  // Writes the small triangles; out.size() == count().
  void write(std::span<shared::SmallTriangle> out, ThreadTeam& team);
  // The large triangles of a slot, ascending.
  std::span<const uint32_t> large(size_t slot) const { return large_[slot]; }
  // Blocks of 64^3 cells that the boxes of a slot's small triangles reach; see TileWindow::blocks.
  uint64_t blocks(size_t slot) const { return blocks_[slot]; }

 private:
  // Cap of the sort's key: triangles that reach more words are sorted as if they reached this many.
  static constexpr int kWordsMax = 96;
  struct Packed {
    shared::SmallTriangle triangle;
    uint32_t key = 0;  // words - 1
  };
  struct Chunk {
    RawVector<Packed> packed;
    size_t packed_count = 0;
    std::array<std::vector<uint32_t>, kSlotsMax> large;
    std::array<uint64_t, kSlotsMax> blocks{};
    size_t places[size_t{kWordsMax}] = {};  // counts, later the next free place of each key
  };
  static void sort_part(const SnappedMesh& mesh, const TilePart& part, Chunk& chunk);

  std::vector<Chunk> chunks_;
  size_t chunk_count_ = 0, count_ = 0;
  std::array<std::vector<uint32_t>, kSlotsMax> large_;
  std::array<uint64_t, kSlotsMax> blocks_{};
};

}  // namespace voxeld
