// The passes that find the inside of a tile on a device, and their buffers: crossings of columns,
// sweeps along them, and the cells of the tile. shaders/shared/solid.h draws the layouts.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/options/options.h"
#include "server/gpu/objects.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/estimates/pipeline.h"
#include "server/voxel/gl/solid/slice_map.h"
#include "server/voxel/gl/solid/sweep_window.h"
#include "shaders/shared/solid.h"

namespace voxeld {

// The sweeps that a job needs.
struct SolidSweeps {
  std::array<size_t, 3> carry_slots{};  // parity along x, y, z; 0: not swept
  bool counts = false;                  // sums of signs along z

  bool votes() const { return carry_slots[0] > 0; }
};
// kAuto is nonzero or majority: the sweeps of both, for an upper bound.
SolidSweeps sweeps_of(Sign sign, const glm::ivec3& tiles);

// The rule by which the bits of columns become cells.
enum class CellsOf {
  kParity,  // along z
  kCounts,  // along z
  kVote,    // two of the parities along x, y, z
};

// Runs the passes. Only the context's thread may use it.
class SolidPasses {
 public:
  SolidPasses(const gpu::Context& context, gpu::ShaderLibrary& shaders)
      : context_(&context), shaders_(&shaders) {}

  // Creates the buffers, zeroed. Errors: those of gpu::Buffer.
  Status begin_job(const SolidSweeps& sweeps, Pipeline pipeline);
  // Frees the buffers.
  void end_job();
  // Bytes of all buffers and textures now, and their maximum.
  int64_t bytes() const;
  static int64_t bytes_max(const SolidSweeps& sweeps);

  // Reset the state below the next tile to "nothing": of parity along the axis, or of counts.
  void clear_carries(int axis, size_t slot);
  void clear_count_carries();
  // Read the state of the columns at the tile's lower end: bits as in shared/solid.h, and sums.
  void read_carries(int axis, size_t slot, std::span<uint32_t> out) const;
  void read_count_carries(std::span<int32_t> out) const;

  // Parity of a tile along an axis. The order is begin, mark for every window, scan.
  Status begin_parity(int axis);
  Status mark_parity(const SweepWindow& window, const SweepTarget& target);
  Status scan_parity(int axis, size_t slot);

  // Sums of a slab of SOLID_SLAB_CELLS along z. The order is begin, mark for every window, scan.
  // thresholds: as in shared/solid.h. If empty, all are 1, or any sum but 0 is inside for kNonzero.
  void begin_counts(int slab);
  Status mark_counts(const SweepWindow& window, const SweepTarget& target);
  Status scan_counts(int slab, Sign sign, std::span<const int32_t> thresholds);

  // cells: the number of the tile's cells that are inside the grid.
  Status make_cells(CellsOf what, const glm::ivec3& cells);
  // Reads SOLID_FLAG_COUNT words.
  void read_flags(std::span<uint32_t> out) const;
  // Read the words of `blocks` of the mask, or of the cells on which the axes disagree.
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
  SliceMap slices_;  // only for pipeline raster
  int parity_axis_ = 2;
  std::array<gpu::Buffer, 3> volumes_, carries_;                    // by axis
  gpu::Buffer count_volume_, counts_, count_carries_, thresholds_;  // along z
  gpu::Buffer mask_, disagree_, flags_;
  gpu::Buffer triangles_, items_, params_;
};

}  // namespace voxeld
