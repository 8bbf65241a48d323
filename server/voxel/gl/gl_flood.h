// sign=flood on a device: bits of the whole grid, and steps along x, y and z in turn until nothing
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

// Bits of a grid on the device, twice. Larger grids are flooded on the CPU.
inline constexpr int64_t kFloodBytesMax = int64_t{128} << 20;
// A flood that has to turn round more often, as in a maze, is for the CPU, which visits what is new
// and not the grid.
inline constexpr int kFloodRoundsMax = 64;

// One thread: the context's.
class GlFlood {
 public:
  GlFlood(const gpu::Context& context, gpu::ShaderLibrary& shaders)
      : context_(&context), shaders_(&shaders) {}

  // DeviceInside::flood_inside(). `other_bytes`: on the device beside what this takes.
  Result<bool> run(std::span<const SparseTile> touched, const glm::ivec3& dims,
                   const ColumnProgress& progress, int64_t other_bytes,
                   std::vector<SparseTile>& tiles, VoxelizeStats& stats);

  // Bytes on the device; 0 where the grid is too large for it.
  int64_t bytes(const glm::ivec3& dims) const;

 private:
  struct Grid;  // bits and their buffers

  Status upload(Grid& grid, std::span<const SparseTile> touched);
  // False where it did not end.
  Result<bool> spread(Grid& grid, const ColumnProgress& progress);
  Status step(Grid& grid, const gpu::Program& program, int axis);
  void take_tiles(const Grid& grid, std::vector<SparseTile>& tiles);

  const gpu::Context* context_;
  gpu::ShaderLibrary* shaders_;
};

}  // namespace voxeld
