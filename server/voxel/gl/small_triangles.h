// The triangles of a tile as pass voxelize_words takes them: those at most 16 voxels wide packed
// into two vectors each, in the order of how many words of the mask their boxes reach, so that the
// lanes of a SIMD group do alike.
#pragma once

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

// Keeps its memory from tile to tile. One thread calls.
class SmallTriangles {
 public:
  // Takes triangles (numbers in `mesh`) of the tile at `tile_coord`; cell_max: tile_cell_max().
  void begin(const SnappedMesh& mesh, const glm::ivec3& tile_coord, const glm::ivec3& cell_max,
             std::span<const uint32_t> triangles, WorkerPool& pool);

  // Of the last begin(). Triangles whose boxes do not reach the tile's cells are in neither.
  size_t count() const { return count_; }
  // Writes the small ones; out.size() == count().
  void write(std::span<shared::SmallTriangle> out, WorkerPool& pool);
  // The others, ascending.
  std::span<const uint32_t> large() const { return large_; }
  // Blocks of 64^3 cells that the boxes of small ones reach, as TileWindow::blocks.
  uint64_t blocks() const { return blocks_; }

 private:
  // More words are as many, to the sort.
  static constexpr int kWordsMax = 96;
  struct Packed {
    shared::SmallTriangle triangle;
    uint32_t key = 0;  // words - 1
  };
  struct Chunk {
    RawVector<Packed> packed;
    std::vector<uint32_t> large;
    uint64_t blocks = 0;
    size_t places[size_t{kWordsMax}] = {};  // counts, then where the next one of a key goes
  };
  void sort_chunk(const SnappedMesh& mesh, const glm::ivec3& tile_q, const glm::ivec3& cell_max,
                  std::span<const uint32_t> triangles, Chunk& chunk);

  std::vector<Chunk> chunks_;
  size_t chunk_count_ = 0, count_ = 0;
  std::vector<uint32_t> large_;
  uint64_t blocks_ = 0;
};

}  // namespace voxeld
