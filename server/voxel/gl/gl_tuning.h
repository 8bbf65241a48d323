// What a context's capabilities choose among, and tests and benchmarks force.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "server/gpu/device.h"

namespace voxeld {

struct GlTuning {
  // Pipeline compute finds work on the device, in batches of tiles, instead of having the CPU
  // prepare it triangle by triangle. Default: on hardware. Software drivers would do that work on
  // the same cores, and slower.
  std::optional<bool> batches{};
  // 64-bit integers in shaders, or two 32-bit words. Default: where the device has them.
  std::optional<bool> int64{};
  // Vertices of animations move by 64-bit floats in shaders, or on the CPU. Default: where the
  // device has them; that their bits are the CPU's is checked in any case.
  std::optional<bool> float64{};
  // Tiles of a batch, 1..64: 2 MiB of masks each. Default: as many as a storage buffer holds.
  std::optional<size_t> batch_tiles{};
  // Of one storage buffer. Default: what the device has.
  std::optional<int64_t> storage_bytes{};

  bool wants_batches(const gpu::DeviceInfo& info) const {
    return batches.value_or(!info.is_software);
  }
  bool has_int64(const gpu::DeviceInfo& info) const { return int64.value_or(info.has_int64); }
  bool has_float64(const gpu::DeviceInfo& info) const { return float64.value_or(info.has_float64); }
};

}  // namespace voxeld
