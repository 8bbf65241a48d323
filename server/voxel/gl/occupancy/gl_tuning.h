// Choices that follow from a context's capabilities. Tests and benchmarks can force them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "server/device/device.h"

namespace voxeld {

struct GlTuning {
  // If true, pipeline compute finds its work on the device, in batches of tiles; else the CPU
  // prepares it triangle by triangle. Default: true on hardware. Software drivers would do that
  // work on the same cores, and slower.
  std::optional<bool> batches{};
  // 64-bit integers in shaders, else two 32-bit words. Default: whether the device has them.
  std::optional<bool> int64{};
  // Vertices of animations move by 64-bit floats in shaders, else on the CPU. Default: whether the
  // device has them. In any case their bits are checked against the CPU's.
  std::optional<bool> float64{};
  // Tiles of a batch, 1..64; each takes 2 MiB of masks. Default: as many as a storage buffer holds.
  std::optional<size_t> batch_tiles{};
  // Columns of cells of one dispatch. Default: as many as take some 50 ms (DispatchPace).
  std::optional<double> dispatch_columns{};
  // Bytes of one storage buffer. Default: the device's limit.
  std::optional<int64_t> storage_bytes{};

  bool wants_batches(const gpu::DeviceInfo& info) const {
    return batches.value_or(!info.is_software);
  }
  bool has_int64(const gpu::DeviceInfo& info) const { return int64.value_or(info.has_int64); }
  bool has_float64(const gpu::DeviceInfo& info) const { return float64.value_or(info.has_float64); }
};

}  // namespace voxeld
