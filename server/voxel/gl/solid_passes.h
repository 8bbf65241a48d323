// The passes that find the inside of a tile on a device, and their buffers: crossings of columns,
// sweeps along them, and the cells of the tile. shaders/shared/solid.h draws the layouts.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/options.h"
#include "server/gpu/objects.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/gl/slice_map.h"
#include "server/voxel/gl/sweep_window.h"
#include "server/voxel/pipeline.h"
#include "shaders/shared/solid.h"

namespace voxeld {

// What a job sweeps.
struct SolidSweeps {
  std::array<size_t, 3> carry_slots{};  // parity along x, y, z; 0: not swept
  bool counts = false;                  // sums of signs along z

  bool votes() const { return carry_slots[0] > 0; }
};
SolidSweeps sweeps_of(Sign sign, const glm::ivec3& tiles);

// How cells are made of the bits of columns.
enum class CellsOf {
  kParity,  // along z
  kCounts,  // along z
  kVote,    // two of the parities along x, y, z
  kMix,     // of counts where the axes disagree; after kVote
};

// One thread: the context's.
class SolidPasses {
 public:
  SolidPasses(const gpu::Context& context, gpu::ShaderLibrary& shaders)
      : context_(&context), shaders_(&shaders) {}

  // Buffers, zeroed. Errors: those of gpu::Buffer.
  Status begin_job(const SolidSweeps& sweeps, Pipeline pipeline);
  // Frees them.
  void end_job();
  // Bytes of all buffers and textures now, and at most.
  int64_t bytes() const;
  static int64_t bytes_max(const SolidSweeps& sweeps);

  // Nothing lies below the next tile: of parity along the axis, of counts.
  void clear_carries(int axis, size_t slot);
  void clear_count_carries();
  // Columns of the tile at its lower end: bits as in shared/solid.h, and sums.
  void read_carries(int axis, size_t slot, std::span<uint32_t> out) const;
  void read_count_carries(std::span<int32_t> out) const;

  // Parity of a tile along an axis: begin, mark() for every window, scan.
  Status begin_parity(int axis);
  Status mark_parity(const SweepWindow& window, const SweepTarget& target);
  Status scan_parity(int axis, size_t slot);

  // Sums of a slab of SOLID_SLAB_CELLS along z: begin, mark for every window, scan. `thresholds`
  // as in shared/solid.h; none: 1, or any but 0 with kNonzero.
  void begin_counts(int slab);
  Status mark_counts(const SweepWindow& window, const SweepTarget& target);
  Status scan_counts(int slab, Sign sign, std::span<const int32_t> thresholds);

  // `cells`: of the tile that are inside the grid.
  Status make_cells(CellsOf what, const glm::ivec3& cells);
  // SOLID_FLAG_COUNT words.
  void read_flags(std::span<uint32_t> out) const;
  // Words of `blocks` of the mask, or of the cells on which the axes disagree.
  void read_cells(uint64_t blocks, std::span<uint32_t> out) const;
  void read_disagreement(uint64_t blocks, std::span<uint32_t> out) const;

 private:
  void bind(const shared::SolidParams& params);
  Status mark_items(const SweepWindow& window, const SweepTarget& target, bool counts);
  Status mark_given(const SweepWindow& window, const SweepTarget& target, bool counts);
  shared::SolidParams params_of(const SweepTarget& target) const;

  const gpu::Context* context_;
  gpu::ShaderLibrary* shaders_;
  SolidSweeps sweeps_;
  Pipeline pipeline_ = Pipeline::kCompute;
  SliceMap slices_;  // pipeline raster
  int parity_axis_ = 2;
  std::array<gpu::Buffer, 3> volumes_, carries_;                    // by axis
  gpu::Buffer count_volume_, counts_, count_carries_, thresholds_;  // along z
  gpu::Buffer mask_, disagree_, flags_;
  gpu::Buffer triangles_, items_, params_;
};

}  // namespace voxeld
