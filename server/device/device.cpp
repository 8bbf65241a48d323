#include "server/device/device.h"

#include <algorithm>
#include <optional>

#include "proto/text/number_text.h"
#include "server/process/machine.h"

namespace voxeld::gpu {

Result<DeviceId> parse_device(std::string_view text) {
  if (text == "llvmpipe") return DeviceId{DeviceKind::kLlvmpipe, 0};
  if (text == "lavapipe") return DeviceId{DeviceKind::kLavapipe, 0};
  if (text == "osmesa") return DeviceId{DeviceKind::kOsmesa, 0};
  if (text == "cpu") return DeviceId{DeviceKind::kCpu, 0};
  constexpr std::string_view kEglPrefix = "egl:";
  if (text.starts_with(kEglPrefix)) {
    const std::string_view digits = text.substr(kEglPrefix.size());
    const auto index = parse_number<int>(digits);
    if (index && *index >= 0) return DeviceId{DeviceKind::kEgl, *index};
  }
  constexpr std::string_view kPciPrefix = "pci:";
  if (text.starts_with(kPciPrefix)) {
    if (const auto address = parse_pci_address(text.substr(kPciPrefix.size()))) {
      return DeviceId{DeviceKind::kEgl, 0, address};
    }
  }
  return Error{
      ErrorCode::kInvalidOption, "unknown device",
      "egl:N (N = 0, 1, …), pci:DOMAIN:BUS:DEVICE.FUNCTION (as pci:0000:3b:00.0), llvmpipe, "
      "lavapipe, osmesa or cpu",
      std::string(text)};
}

std::string device_name(const DeviceId& device) {
  switch (device.kind) {
    case DeviceKind::kEgl:
      return device.address ? "pci:" + pci_address_text(*device.address)
                            : "egl:" + std::to_string(device.index);
    case DeviceKind::kLlvmpipe:
      return "llvmpipe";
    case DeviceKind::kLavapipe:
      return "lavapipe";
    case DeviceKind::kOsmesa:
      return "osmesa";
    case DeviceKind::kCpu:
      return "cpu";
  }
  return "";
}

namespace {

const DeviceProbe* find_kind(const std::vector<DeviceProbe>& probes, DeviceKind kind) {
  for (const DeviceProbe& probe : probes) {
    if (probe.works && probe.device.kind == kind) return &probe;
  }
  return nullptr;
}

const DeviceProbe* find_hardware(const std::vector<DeviceProbe>& probes) {
  const DeviceProbe* best = nullptr;
  for (const DeviceProbe& probe : probes) {
    if (!probe.works || probe.info.is_software || probe.device.kind != DeviceKind::kEgl) continue;
    if (best == nullptr || probe.device.index < best->device.index) best = &probe;
  }
  return best;
}

}  // namespace

bool is_software_renderer(std::string_view renderer) {
  constexpr std::string_view kNames[] = {
      "llvmpipe",           "softpipe", "swiftshader", "lavapipe", "swrast", "openswr",
      "software",              // "Software Rasterizer", "Apple Software Renderer"
      "basic render driver"};  // Windows' WARP, by Mesa's d3d12 in WSL
  std::string lower(renderer);
  std::ranges::transform(lower, lower.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return std::ranges::any_of(
      kNames, [&](std::string_view name) { return lower.find(name) != std::string::npos; });
}

DeviceInfo cpu_device_info() {
  DeviceInfo info;
  info.device = {DeviceKind::kCpu, 0};
  info.vendor = "voxeld";
  info.renderer = cpu_model() + ", " + std::to_string(cpu_thread_count()) + " threads";
  info.version = "none";
  info.backend = "no OpenGL";
  info.is_software = true;
  info.dispatch_groups_max = 0;
  return info;
}

namespace {

// Names the first device that only the sandbox keeps from working.
std::string kept_out_text(const std::vector<DeviceProbe>& probes) {
  for (const DeviceProbe& probe : probes) {
    if (probe.is_kept_out) {
      return "; " + device_name(probe.device) +
             " opens outside of the workers' sandbox alone: `voxeld doctor` tells more";
    }
  }
  return "";
}

}  // namespace

AutoChoice choose_device(const std::vector<DeviceProbe>& probes) {
  if (const DeviceProbe* hardware = find_hardware(probes)) {
    return AutoChoice{hardware->device,
                      device_name(hardware->device) +
                          " is the first hardware device that works: " + hardware->info.renderer};
  }
  for (const DeviceKind kind :
       {DeviceKind::kLlvmpipe, DeviceKind::kLavapipe, DeviceKind::kOsmesa}) {
    if (const DeviceProbe* software = find_kind(probes, kind)) {
      return AutoChoice{software->device, "no hardware device works; " +
                                              device_name(software->device) +
                                              " is the fastest software driver that does: " +
                                              software->info.renderer + kept_out_text(probes)};
    }
  }
  std::string reasons;
  for (const DeviceProbe& probe : probes) {
    if (probe.works || reasons.find(probe.reason) != std::string::npos) continue;
    reasons += (reasons.empty() ? "" : "; ") + probe.reason;
  }
  return AutoChoice{{DeviceKind::kCpu, 0},
                    "no OpenGL device works, so everything runs on the CPU: " + reasons};
}

}  // namespace voxeld::gpu
