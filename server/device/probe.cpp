// Probing of devices in child processes. A driver may crash or hang while it loads. Mesa keeps its
// first choice of driver for the life of a process, so two cannot be tried in one.

#include <algorithm>
#include <nlohmann/json.hpp>

#include "server/device/auto_device.h"
#include "server/device/device.h"
#include "server/process/child_process.h"

namespace voxeld::gpu {
namespace {

using nlohmann::json;

// The most EGL devices that are probed.
constexpr int kEglDevicesMax = 16;
constexpr const char* kNoSandbox = "off";

DeviceInfo info_from_json(const DeviceId& device, const json& object) {
  DeviceInfo info;
  info.device = device;
  info.vendor = object.value("vendor", "");
  info.renderer = object.value("renderer", "");
  info.version = object.value("version", "");
  info.glsl_version = object.value("glsl_version", "");
  info.backend = object.value("backend", "");
  info.pci_address = object.value("pci_address", "");
  info.is_robust = object.value("is_robust", false);
  info.is_software = object.value("is_software", false);
  info.has_int64 = object.value("has_int64", false);
  info.has_float64 = object.value("has_float64", false);
  info.has_timer_queries = object.value("has_timer_queries", false);
  info.ssbo_bytes_max = object.value("ssbo_bytes_max", int64_t{0});
  info.ssbo_bindings_max = object.value("ssbo_bindings_max", 0);
  info.ubo_bytes_max = object.value("ubo_bytes_max", 0);
  info.texture_side_max = object.value("texture_side_max", 0);
  info.texture3d_side_max = object.value("texture3d_side_max", 0);
  info.framebuffer_side_max = object.value("framebuffer_side_max", 0);
  info.dispatch_groups_max = object.value("dispatch_groups_max", int64_t{0});
  info.loop_iterations_max = object.value("loop_iterations_max", int64_t{0});
  return info;
}

struct ProbeOutcome {
  DeviceProbe probe;
  int egl_device_count = -1;  // devices that EGL enumerates; -1: the child did not say
};

ProbeOutcome probe_once(const ProbeSettings& settings, const DeviceId& device,
                        const std::string& sandbox) {
  ProbeOutcome outcome;
  outcome.probe.device = device;
  const ChildReply reply = run_child(
      {settings.executable, "probe-device", "--device", device_name(device), "--sandbox", sandbox},
      settings.timeout_each);
  const json object = json::parse(last_json_line(reply.text), nullptr, /*allow_exceptions=*/false);
  if (!object.is_object()) {
    outcome.probe.reason = device_name(device) + ": " +
                           (reply.failure.empty() ? "the probe gave no reply" : reply.failure);
    return outcome;
  }
  try {
    outcome.egl_device_count = object.value("egl_device_count", -1);
    outcome.probe.works = object.value("works", false) && reply.failure.empty();
    outcome.probe.reason = object.value("reason", "");
    outcome.probe.context_ms = object.value("context_ms", 0.0);
    if (outcome.probe.works) outcome.probe.info = info_from_json(device, object.at("info"));
  } catch (const json::exception& error) {
    outcome.probe.works = false;
    outcome.probe.reason = std::string("the probe's reply is not understood: ") + error.what();
  }
  if (!reply.failure.empty() && outcome.probe.reason.empty()) {
    outcome.probe.reason = device_name(device) + ": " + reply.failure;
  }
  return outcome;
}

ProbeOutcome probe_one(const ProbeSettings& settings, const DeviceId& device) {
  ProbeOutcome outcome = probe_once(settings, device, settings.sandbox);
  if (outcome.probe.works || !settings.compares_sandbox || settings.sandbox == kNoSandbox) {
    return outcome;
  }
  const ProbeOutcome outside = probe_once(settings, device, kNoSandbox);
  // A driver that is hidden may take a device out of the enumeration.
  outcome.egl_device_count = std::max(outcome.egl_device_count, outside.egl_device_count);
  if (!outside.probe.works) return outcome;
  outcome.probe.is_kept_out = true;
  outcome.probe.reason += "; outside of the sandbox it opens, as " + outside.probe.info.renderer +
                          ": the sandbox of workers keeps a file or system call from the driver";
  return outcome;
}

// Probes EGL devices in order, until `is_enough` returns true for one.
template <typename IsEnough>
std::vector<DeviceProbe> probe_egl_devices(const ProbeSettings& settings, IsEnough&& is_enough) {
  std::vector<DeviceProbe> probes;
  // egl:0 is always probed, so that its reason tells why there is no hardware.
  int egl_device_count = kEglDevicesMax;
  for (int index = 0; index == 0 || index < egl_device_count; ++index) {
    ProbeOutcome outcome = probe_one(settings, {DeviceKind::kEgl, index});
    if (outcome.egl_device_count >= 0) {
      egl_device_count = std::min(outcome.egl_device_count, kEglDevicesMax);
    }
    probes.push_back(std::move(outcome.probe));
    // If this child could not be started, the next would not start either.
    if (outcome.egl_device_count < 0 && index > 0 && !probes.back().works) break;
    if (is_enough(probes.back())) break;
  }
  return probes;
}

constexpr DeviceKind kSoftwareKinds[] = {DeviceKind::kLlvmpipe, DeviceKind::kLavapipe,
                                         DeviceKind::kOsmesa};

}  // namespace

std::vector<DeviceProbe> probe_devices(const ProbeSettings& settings) {
  auto probes = probe_egl_devices(settings, [](const DeviceProbe&) { return false; });
  for (const DeviceKind kind : kSoftwareKinds) {
    probes.push_back(probe_one(settings, {kind, 0}).probe);
  }
  DeviceProbe cpu;
  cpu.device = {DeviceKind::kCpu, 0};
  cpu.works = true;
  cpu.info = cpu_device_info();
  probes.push_back(std::move(cpu));
  return probes;
}

AutoChoice probe_auto_device(const ProbeSettings& settings) {
  const auto is_hardware = [](const DeviceProbe& probe) {
    return probe.works && !probe.info.is_software;
  };
  auto probes = probe_egl_devices(settings, is_hardware);
  if (is_hardware(probes.back())) return choose_device(probes);
  for (const DeviceKind kind : kSoftwareKinds) {
    probes.push_back(probe_one(settings, {kind, 0}).probe);
    if (probes.back().works) break;
  }
  return choose_device(probes);
}

}  // namespace voxeld::gpu
