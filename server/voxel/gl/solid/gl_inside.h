// The inside of a mesh by passes on a device, tile by tile, with the tiles of InsideFinder in
// solid/inside.h. Two parts stay on the CPU: thresholds of winding numbers, whose solid angles are
// doubles, and crossings of triangles that are too large for 64 bits.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/gpu/pass_timer.h"
#include "server/voxel/gl/solid/solid_passes.h"
#include "server/voxel/gl/solid/sweep_bins.h"
#include "server/voxel/solid/device_inside.h"
#include "server/voxel/solid/inside/thresholds.h"
#include "server/voxel/solid/inside/winding_field.h"

namespace voxeld {

// Finds insides. Between jobs it keeps programs and host memory, but no device memory. Not
// thread-safe.
class GlInside {
 public:
  GlInside(const gpu::Context& context, gpu::ShaderLibrary& shaders);

  // An upper bound of the peak bytes of run() on the device.
  static int64_t bytes_max(const glm::ivec3& dims, Sign sign);
  // Implements DeviceInside::find_inside(). other_bytes: device bytes taken by others.
  Status run(const InsideJob& job, const ColumnProgress& progress, int64_t other_bytes,
             std::vector<SparseTile>& tiles, AxisVotes& votes, VoxelizeStats& stats);

 private:
  struct Job;
  // The current tile.
  struct Place {
    glm::ivec3 tile{0};
    glm::ivec3 cells{0};  // cells of the tile that are inside the grid
    glm::ivec3 first() const { return tile * limits::kTileSide; }
    bool is_whole() const;
  };

  Status run_job(Job& job, const ColumnProgress& progress);
  Status run_tile(Job& job, const Place& place);
  Status vote(Job& job, const Place& place);
  bool is_touched(const Job& job, const Place& place) const;
  // The state of a tile without surface. 0: all outside, 1: all inside; nullopt: mixed.
  std::optional<int> uniform_state(const Job& job, const Place& place);
  std::optional<int> uniform_parity(int axis, size_t slot);
  std::optional<int> uniform_counts(Sign sign);
  Status sweep_parity(Job& job, const Place& place, int axis);
  Status sweep_counts(Job& job, const Place& place);
  Status mark_slab(Job& job, const SweepBins& bins, const FillMesh& mesh,
                   const SweepTarget& target);
  void slab_thresholds(Job& job, const Place& place, int slab);
  void count_votes(Job& job, const Place& place);
  void take_tile(Job& job, const Place& place);
  SweepTarget target_of(const Place& place, int axis) const;

  const gpu::Context* context_;
  SolidPasses passes_;
  std::optional<gpu::PassTimer> timer_;
  SweepWindow window_;
  Thresholds thresholds_;
  std::vector<int32_t> slab_thresholds_, sums_;
  std::vector<uint32_t> mask_, flags_, carries_;
};

}  // namespace voxeld
