// sign=flood on a device: bits of the whole grid, spread along x, y and z in turn until nothing
// changes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/gpu/objects.h"
#include "server/gpu/pass_timer.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/solid/device_inside.h"

namespace voxeld {

// The most bytes of the grid's bits on the device, which holds them twice. Larger grids are flooded
// on the CPU.
inline constexpr int64_t kFloodBytesMax = int64_t{128} << 20;
// The most rounds on the device. A flood that turns more often, as in a maze, runs on the CPU,
// which visits only new cells and not the whole grid.
inline constexpr int kFloodRoundsMax = 64;

// Floods grids. Only the context's thread may use it.
class GlFlood {
 public:
  GlFlood(const gpu::Context& context, gpu::ShaderLibrary& shaders)
      : context_(&context), shaders_(&shaders) {}

  // Implements DeviceInside::flood_inside(). other_bytes: device bytes taken by others.
  Result<bool> run(std::span<const SparseTile> touched, const glm::ivec3& dims,
                   const ColumnProgress& progress, int64_t other_bytes,
                   std::vector<SparseTile>& tiles, VoxelizeStats& stats);

  // Bytes on the device; 0 if the grid is too large for it.
  int64_t bytes(const glm::ivec3& dims) const;

 private:
  struct Grid;  // bits and their buffers

  Status upload(Grid& grid, std::span<const SparseTile> touched);
  // False if kFloodRoundsMax rounds did not finish the flood.
  Result<bool> spread(Grid& grid, const ColumnProgress& progress);
  Status step(Grid& grid, const gpu::Program& program, int axis);
  void take_tiles(const Grid& grid, std::vector<SparseTile>& tiles);

  const gpu::Context* context_;
  gpu::ShaderLibrary* shaders_;
};

}  // namespace voxeld
