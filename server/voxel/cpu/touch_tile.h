// Occupancy on the CPU: the cells of a tile that the snapped triangles occupy by rule touch, thin
// or center, exactly as ../README.md defines. The bits do not depend on the instruction set or the
// number of threads.
//
// By rule touch, triangles up to 16 voxels wide run a batch at a time, one per lane
// (touch_small.h). Larger ones run one by one, a lane for each row of cells (touch_large.h). The
// other rules do the same along each axis (lines_small.h, lines_large.h). Threads either share a
// tile's triangles, each setting bits in its own copy of the tile, or take a whole tile each. The
// copies are joined block by block.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/options/options.h"
#include "server/base/huge_array.h"
#include "server/base/parallel.h"
#include "server/base/simd/cpu_isa.h"
#include "server/grid/grid_spec.h"
#include "server/voxel/cpu/kernels/touch_kernel.h"
#include "server/voxel/triangles/bin.h"
#include "server/voxel/triangles/snap.h"

namespace voxeld {

// The kernel's view of a bin. It points into `mesh` and `bin`.
TouchInput touch_input(const SnappedMesh& mesh, const GridSpec& spec, const TileBin& bin);

// Runs the kernels. It keeps 2 MiB per thread between calls. Not thread-safe.
class CpuTouch {
 public:
  // threads: 0 means one per hardware thread. The instruction set must be supported.
  explicit CpuTouch(int threads, CpuIsa isa = best_cpu_isa());

  // Sets the rule of the following calls of run(). The default is touch; none sets nothing.
  void set_rule(Rule rule) { rule_ = rule; }

  // Sets the bits of all cells of the tile that the bin's triangles occupy. mask: kTileMaskWords
  // words in the layout of TileDevice::read_mask, whose old contents do not matter. Returns the
  // blocks whose words are valid, see TileWindow::blocks. The triangles touch nothing in other
  // blocks (except by rule none, which returns none).
  uint64_t run(const SnappedMesh& mesh, const GridSpec& spec, const TileBin& bin,
               std::span<uint32_t> mask);

  // The same, with the result as bricks appended to `tile`, in order. Returns the number of voxels.
  uint64_t run(const SnappedMesh& mesh, const GridSpec& spec, const TileBin& bin, SparseTile& tile);

  // Appends the bricks of bins[i] to tiles[i]. Faster than one call for each tile if there are
  // several tiles per thread. Returns the number of voxels.
  uint64_t run(const SnappedMesh& mesh, const GridSpec& spec, std::span<const TileBin> bins,
               std::span<SparseTile> tiles);

  int threads() const { return team_.threads(); }
  ThreadTeam& team() { return team_; }

 private:
  struct Worker {
    // kTouchWords, all 0 between calls; empty before the first use and after a cancelled one.
    HugeArray words;
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
  // Calls visit(block, tiles with bits in it) for those of `blocks` that the first `parts` workers
  // wrote.
  template <typename Visit>
  void for_each_block(size_t parts, uint64_t blocks, const Visit& visit);
  void compact_blocks(size_t parts, uint64_t blocks, Worker& worker, SparseTile& tile);

  // Drops the words of a call that ended by an exception: they are not 0.
  void begin();
  // Runs the kernel on the worker's own words. Returns the blocks.
  uint64_t occupy(const TouchInput& input, Worker& worker) const;
  uint64_t occupy_by(const TouchInput& input, Worker& worker) const;

  const TouchKernel* kernel_;
  Rule rule_ = Rule::kTouch;
  ThreadTeam team_;
  std::vector<Worker> workers_;
  bool is_running_ = false;
};

}  // namespace voxeld
