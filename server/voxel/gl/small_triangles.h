// The triangles of some tiles as pass voxelize_words takes them: those at most 16 voxels wide
// packed into two vectors each, in the order of how many words of the mask their boxes reach, so
// that the lanes of a SIMD group do alike.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "server/voxel/cpu/worker_pool.h"
#include "server/voxel/raw_vector.h"
#include "server/voxel/snap.h"
#include "shaders/shared/voxelize.h"

namespace voxeld {

// Triangles of one tile.
struct TilePart {
  uint32_t slot = 0;                 // of the tile among the masks, below SmallTriangles::kSlotsMax
  glm::ivec3 coord{0}, cell_max{0};  // in tiles; tile_cell_max()
  std::span<const uint32_t> triangles;  // numbers in the mesh
};

// Keeps its memory from call to call. One thread calls.
class SmallTriangles {
 public:
  static constexpr size_t kSlotsMax = 8;

  // Takes the triangles of at most kSlotsMax tiles, each in a slot of its own.
  void begin(const SnappedMesh& mesh, std::span<const TilePart> parts, WorkerPool& pool);

  // Of the last begin(). Triangles whose boxes do not reach the tile's cells are in neither.
  size_t count() const { return count_; }
  // Writes the small ones; out.size() == count().
  void write(std::span<shared::SmallTriangle> out, WorkerPool& pool);
  // The others of a slot, ascending.
  std::span<const uint32_t> large(size_t slot) const { return large_[slot]; }
  // Blocks of 64^3 cells that the boxes of a slot's small ones reach, as TileWindow::blocks.
  uint64_t blocks(size_t slot) const { return blocks_[slot]; }

 private:
  // More words are as many, to the sort.
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
    size_t places[size_t{kWordsMax}] = {};  // counts, then where the next one of a key goes
  };
  static void sort_part(const SnappedMesh& mesh, const TilePart& part, Chunk& chunk);

  std::vector<Chunk> chunks_;
  size_t chunk_count_ = 0, count_ = 0;
  std::array<std::vector<uint32_t>, kSlotsMax> large_;
  std::array<uint64_t, kSlotsMax> blocks_{};
};

}  // namespace voxeld
