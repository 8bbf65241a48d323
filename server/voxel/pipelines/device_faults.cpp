#include "server/voxel/pipelines/device_faults.h"

#include <algorithm>

#include "server/base/check.h"

namespace voxeld {
namespace {

constexpr std::array<std::string_view, kDevicePartCount> kPartNames = {
    "compute", "compute-attributes", "raster", "raster-attributes", "solid", "images"};

}  // namespace

std::string_view device_part_name(DevicePart part) {
  return kPartNames[static_cast<size_t>(part)];
}

std::optional<DevicePart> device_part_from(std::string_view name) {
  const auto* const found = std::ranges::find(kPartNames, name);
  if (found == kPartNames.end()) return std::nullopt;
  return static_cast<DevicePart>(found - kPartNames.begin());
}

DevicePart surface_part(Pipeline pipeline, bool attributes) {
  VOXELD_CHECK(pipeline != Pipeline::kCpu, "pipeline cpu is no part of a device");
  if (pipeline == Pipeline::kCompute) {
    return attributes ? DevicePart::kComputeAttributes : DevicePart::kCompute;
  }
  return attributes ? DevicePart::kRasterAttributes : DevicePart::kRaster;
}

bool DeviceFaults::any() const {
  return std::ranges::any_of(why_, [](const std::string& why) { return !why.empty(); });
}

void DeviceFaults::add(DevicePart part, std::string why) {
  VOXELD_CHECK(!why.empty(), "a fault without a reason");
  std::string& kept = why_[static_cast<size_t>(part)];
  if (kept.empty()) kept = std::move(why);
}

std::string DeviceFaults::text() const {
  std::string text;
  for (size_t i = 0; i < kDevicePartCount; ++i) {
    if (why_[i].empty()) continue;
    const auto* const first = std::ranges::find(why_, why_[i]);
    if (first != why_.begin() + i) continue;
    std::string parts;
    for (size_t k = i; k < kDevicePartCount; ++k) {
      if (why_[k] != why_[i]) continue;
      parts.append(parts.empty() ? "" : ", ").append(kPartNames[k]);
    }
    text.append(text.empty() ? "" : "; ").append(parts).append(": ").append(why_[i]);
  }
  return text;
}

DeviceFaults all_faulty(const std::string& why) {
  DeviceFaults faults;
  for (size_t i = 0; i < kDevicePartCount; ++i) faults.add(static_cast<DevicePart>(i), why);
  return faults;
}

}  // namespace voxeld
