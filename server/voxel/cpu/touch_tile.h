// Occupancy on the CPU: which cells of a tile the snapped triangles occupy by rule touch, thin or
// center, exactly as ../README.md defines, with the same bits from every instruction set and
// number of threads.
//
// By rule touch, triangles up to 16 voxels wide are done a batch at a time, a lane for each
// (touch_small.h), others one by one, a lane for each row of cells (touch_large.h); the other
// rules do the same along each axis (lines_small.h, lines_large.h). Threads share a tile's
// triangles, each with a tile of its own to set bits in, which are joined block by block; or they
// take a tile each.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/options.h"
#include "proto/sparse_tile.h"
#include "server/grid/grid_spec.h"
#include "server/voxel/bin.h"
#include "server/voxel/cpu/cpu_isa.h"
#include "server/voxel/cpu/huge_array.h"
#include "server/voxel/cpu/touch_kernel.h"
#include "server/voxel/cpu/worker_pool.h"
#include "server/voxel/snap.h"

namespace voxeld {

// What a kernel reads of a bin. Points into `mesh` and `bin`.
TouchInput touch_input(const SnappedMesh& mesh, const GridSpec& spec, const TileBin& bin);

// Keeps 2 MiB per thread between calls. One thread calls.
class CpuTouch {
 public:
  // `threads`: 0 is as many as the machine has. The instruction set must be supported.
  explicit CpuTouch(int threads, CpuIsa isa = best_cpu_isa());

  // What the following calls of run() set: touch until this is called; none sets nothing.
  void set_rule(Rule rule) { rule_ = rule; }

  // Sets the bits of all cells of the tile that the bin's triangles occupy. `mask`: kTileMaskWords
  // words in the layout of TileDevice::read_mask, whose old contents do not matter. Returns the
  // blocks whose words are valid, as TileWindow::blocks; the triangles touch nothing in others
  // (except by rule none, which returns none).
  uint64_t run(const SnappedMesh& mesh, const GridSpec& spec, const TileBin& bin,
               std::span<uint32_t> mask);

  // The same, as bricks appended to `tile`, in order. Returns the number of voxels.
  uint64_t run(const SnappedMesh& mesh, const GridSpec& spec, const TileBin& bin, SparseTile& tile);

  // Appends to tiles[i] the bricks of bins[i]. Faster than one call for each where there are
  // several tiles for each thread. Returns the number of voxels.
  uint64_t run(const SnappedMesh& mesh, const GridSpec& spec, std::span<const TileBin> bins,
               std::span<SparseTile> tiles);

  int threads() const { return pool_.threads(); }
  WorkerPool& pool() { return pool_; }

 private:
  struct Worker {
    HugeArray words;  // kTouchWords, tiles all 0 between calls; none before the first
    void reserve() {
      if (words.data() == nullptr) words = HugeArray(kTouchWords);
    }
    uint64_t blocks = 0;
    uint64_t voxels = 0;
    SparseTile part;  // bricks of this worker's blocks
    CompactedBlock compacted;
  };

  // Shares the bin's triangles among workers; returns their number.
  size_t touch_shared(const SnappedMesh& mesh, const GridSpec& spec, const TileBin& bin);
  void touch_part(const SnappedMesh& mesh, const GridSpec& spec, const TileBin& bin, size_t part,
                  size_t parts);
  // Calls visit(block, tiles with bits in it) for the blocks of the first `parts` workers, from
  // `blocks`.
  template <typename Visit>
  void for_each_block(size_t parts, uint64_t blocks, const Visit& visit);
  void compact_blocks(size_t parts, uint64_t blocks, Worker& worker, SparseTile& tile);

  // Of a worker's own words.
  uint64_t occupy(const TouchInput& input, Worker& worker) const;

  const TouchKernel* kernel_;
  Rule rule_ = Rule::kTouch;
  WorkerPool pool_;
  std::vector<Worker> workers_;
};

}  // namespace voxeld
