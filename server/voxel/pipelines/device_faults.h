// The parts of a device that are not used, because they make other bytes than the CPU.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "server/voxel/estimates/pipeline.h"

namespace voxeld {

// The parts that a self-test tells apart. Requests for one can run where another is faulty.
enum class DevicePart {
  kCompute,            // pipeline compute without attributes
  kComputeAttributes,  // colours, normals, ids and coverage of pipeline compute
  kRaster,
  kRasterAttributes,
  kSolid,   // the inside of solids and shells
  kImages,  // renderer gl
};
inline constexpr size_t kDevicePartCount = 6;

// "compute", "compute-attributes", "raster", "raster-attributes", "solid", "images".
std::string_view device_part_name(DevicePart part);
std::optional<DevicePart> device_part_from(std::string_view name);
// The part that makes a grid's surface. Pipeline cpu is none.
DevicePart surface_part(Pipeline pipeline, bool attributes);

// Faults by part; at first there are none.
class DeviceFaults {
 public:
  bool any() const;
  bool has(DevicePart part) const { return !why(part).empty(); }
  // How the part failed; empty if it is in order.
  const std::string& why(DevicePart part) const { return why_[static_cast<size_t>(part)]; }
  // Adds a fault. The first of a part is kept. `why` must not be empty.
  void add(DevicePart part, std::string why);
  // "compute: touch: other voxels than the CPU's; images: …"; empty without faults. A reason that
  // several parts share is given once.
  std::string text() const;

  bool operator==(const DeviceFaults&) const = default;

 private:
  std::array<std::string, kDevicePartCount> why_;
};

// Every part of a device, for the same reason.
DeviceFaults all_faulty(const std::string& why);

}  // namespace voxeld
