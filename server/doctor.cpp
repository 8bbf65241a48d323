#include "server/doctor.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "proto/version.h"
#include "server/device/device.h"
#include "server/device/missing_driver.h"
#include "server/device/workarounds.h"
#include "server/exit_status.h"
#include "server/worker/device/calibrate_device.h"
#include "server/worker/device/test_device.h"
#include "server/worker/worker_sandbox.h"

namespace voxeld {
namespace {

using gpu::DeviceInfo;
using gpu::DeviceKind;
using gpu::DeviceProbe;
using nlohmann::json;

// "128 MiB", "64 KiB"; rounded down.
std::string bytes_text(int64_t bytes) {
  constexpr int64_t kMiB = int64_t{1} << 20;
  if (bytes >= kMiB) return std::to_string(bytes / kMiB) + " MiB";
  return std::to_string(bytes / 1024) + " KiB";
}

// Advice for a device that does not work; empty if nothing helps.
std::string hint_for(const DeviceProbe& probe) {
  const auto says = [&](std::string_view text) {
    return probe.reason.find(text) != std::string::npos;
  };
  if (probe.is_kept_out) {
    return refusals_command(gpu::device_name(probe.device)) +
           ": lists what failed (EACCES, EPERM, ENOSYS)";
  }
  if (says("built without OpenGL")) return "build with VOXELD_WITH_GL=ON";
  if (says("libEGL.so.1")) return "apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri";
  switch (probe.device.kind) {
    case DeviceKind::kEgl:
      return gpu::missing_driver();
    case DeviceKind::kLlvmpipe:
      return "apt-get install libegl-mesa0 libgl1-mesa-dri";
    case DeviceKind::kLavapipe:
      return "apt-get install libegl-mesa0 libgl1-mesa-dri mesa-vulkan-drivers";
    case DeviceKind::kOsmesa:
      return "apt-get install libosmesa6";
    case DeviceKind::kCpu:
      break;
  }
  return "";
}

std::string limits_text(const DeviceInfo& info) {
  std::string text = "storage buffers " + bytes_text(info.ssbo_bytes_max) + " x " +
                     std::to_string(info.ssbo_bindings_max) + ", uniforms " +
                     bytes_text(info.ubo_bytes_max) + ", textures " +
                     std::to_string(info.texture_side_max) + "^2 " +
                     std::to_string(info.texture3d_side_max) + "^3, framebuffer " +
                     std::to_string(info.framebuffer_side_max) + "^2, groups " +
                     std::to_string(info.dispatch_groups_max);
  if (info.loop_iterations_max > 0) {
    text += ", loop iterations " + std::to_string(info.loop_iterations_max);
  }
  return text;
}

void print_device(const DeviceProbe& probe) {
  std::printf("%-10s %s\n", gpu::device_name(probe.device).c_str(),
              probe.works ? probe.info.renderer.c_str() : "does not work");
  if (!probe.works) {
    std::printf("%-10s   why     %s\n", "", probe.reason.c_str());
    const std::string hint = hint_for(probe);
    if (!hint.empty()) std::printf("%-10s   hint    %s\n", "", hint.c_str());
    return;
  }
  if (probe.device.kind == DeviceKind::kCpu) {
    std::printf("%-10s   kind    no OpenGL: pipeline cpu and the ray march on the CPU\n", "");
    return;
  }
  const DeviceInfo& info = probe.info;
  std::printf("%-10s   kind    %s, opened in %.0f ms\n", "",
              info.is_software ? "software" : "hardware", probe.context_ms);
  std::printf("%-10s   driver  OpenGL %s, GLSL %s, %s\n", "", info.version.c_str(),
              info.glsl_version.c_str(), info.vendor.c_str());
  std::printf("%-10s   through %s%s\n", "", info.backend.c_str(), info.is_robust ? ", robust" : "");
  if (!info.pci_address.empty()) {
    std::printf("%-10s   address pci:%s\n", "", info.pci_address.c_str());
  }
  std::printf("%-10s   limits  %s\n", "", limits_text(info).c_str());
  std::printf("%-10s   shaders %s, %s\n", "",
              info.has_int64 ? "64-bit integers" : "no 64-bit integers",
              info.has_float64 ? "64-bit floats" : "no 64-bit floats");
  std::printf("%-10s   timing  %s\n", "",
              info.has_timer_queries ? "timer queries" : "wall clock (timer_query_zero)");
}

json device_json(const DeviceProbe& probe) {
  json object = {{"device", gpu::device_name(probe.device)}, {"works", probe.works}};
  if (!probe.works) {
    object["reason"] = probe.reason;
    object["is_kept_out"] = probe.is_kept_out;
    object["hint"] = hint_for(probe);
    return object;
  }
  const DeviceInfo& info = probe.info;
  object.update({{"renderer", info.renderer},
                 {"vendor", info.vendor},
                 {"gl_version", info.version},
                 {"glsl_version", info.glsl_version},
                 {"backend", info.backend},
                 {"pci_address", info.pci_address},
                 {"is_software", info.is_software},
                 {"is_robust", info.is_robust},
                 {"has_int64", info.has_int64},
                 {"has_float64", info.has_float64},
                 {"has_timer_queries", info.has_timer_queries},
                 {"context_ms", probe.context_ms}});
  object["limits"] = {{"ssbo_bytes_max", info.ssbo_bytes_max},
                      {"ssbo_bindings_max", info.ssbo_bindings_max},
                      {"ubo_bytes_max", info.ubo_bytes_max},
                      {"texture_side_max", info.texture_side_max},
                      {"texture3d_side_max", info.texture3d_side_max},
                      {"framebuffer_side_max", info.framebuffer_side_max},
                      {"dispatch_groups_max", info.dispatch_groups_max},
                      {"loop_iterations_max", info.loop_iterations_max}};
  return object;
}

// Nothing: it was not asked for.
using Calibrated = std::optional<Result<CalibrationReport>>;

Result<std::vector<gpu::DeviceId>> devices_to_calibrate(const DoctorCommand& command,
                                                        const std::vector<DeviceProbe>& probes) {
  std::vector<gpu::DeviceId> devices;
  for (const std::string& name : command.devices) {
    VOXELD_ASSIGN(const gpu::DeviceId device, gpu::parse_device(name));
    devices.push_back(device);
  }
  if (!command.devices.empty()) return devices;
  for (const DeviceProbe& probe : probes) {
    if (probe.works) devices.push_back(probe.device);
  }
  return devices;
}

// Tests a device anew; print_text() and print_json() show the outcome that is kept.
void test_for_doctor(const std::string& self_executable, const DoctorCommand& command,
                     const gpu::DeviceId& device) {
  if (device.kind == DeviceKind::kCpu) return;
  const SelfTestReport report = test_device({.executable = self_executable,
                                             .sandbox = command.sandbox,
                                             .data_dir = command.data_dir,
                                             .tests_again = true},
                                            device);
  for (const std::string& problem : {report.failure, report.warning}) {
    if (problem.empty()) continue;
    std::fprintf(stderr, "voxeld: self-test of %s: %s\n", gpu::device_name(device).c_str(),
                 problem.c_str());
  }
}

void print_calibration(const Result<CalibrationReport>& report) {
  if (!report) {
    std::printf("\nnot calibrated: %s\n", report.error().message().c_str());
    return;
  }
  std::printf("\nmeasured, and stored in %s; workers that start from now on use it\n",
              report->path.c_str());
  if (!report->warning.empty()) std::printf("warning: %s\n", report->warning.c_str());
  std::printf("%-10s %s\n", "device", calibration_table_head().c_str());
  for (const CalibratedDevice& device : report->devices) {
    if (!device.failure.empty()) {
      std::printf("%-10s could not be measured: %s\n", device.device.c_str(),
                  device.failure.c_str());
    }
    for (const std::string& row : device.rows) {
      std::printf("%-10s %s\n", device.device.c_str(), row.c_str());
    }
  }
}

json calibration_json(const Result<CalibrationReport>& report) {
  if (!report) return {{"error", report.error().message()}};
  json object = {{"path", report->path.string()}, {"devices", json::array()}};
  if (!report->warning.empty()) object["warning"] = report->warning;
  for (const CalibratedDevice& device : report->devices) {
    object["devices"].push_back({{"device", device.device}, {"failure", device.failure}});
  }
  return object;
}

int calibration_status(const Calibrated& calibrated) {
  if (!calibrated) return 0;
  if (!calibrated->ok()) return 1;
  const auto& devices = (*calibrated)->devices;
  return std::any_of(devices.begin(), devices.end(),
                     [](const CalibratedDevice& device) { return !device.failure.empty(); })
             ? 1
             : 0;
}

void print_text(const std::vector<DeviceProbe>& probes, const gpu::AutoChoice& choice,
                const DoctorCommand& command) {
  std::printf("voxeld %s\n\n", std::string(version()).c_str());
  for (const DeviceProbe& probe : probes) {
    print_device(probe);
    if (probe.works) {
      std::printf("%-10s   auto    %s\n", "",
                  calibration_state(command.data_dir, probe.info).c_str());
      if (probe.device.kind != DeviceKind::kCpu) {
        std::printf("%-10s   tested  %s\n", "",
                    self_test_state(command.data_dir, probe.info).c_str());
      }
    }
  }
  std::printf("\ndriver workarounds (VOXELD_WORKAROUNDS=-name turns one off)\n");
  for (const gpu::WorkaroundInfo& one : gpu::all_workarounds()) {
    std::printf("  %-3s %-22s %s\n", gpu::workaround_enabled(one.workaround) ? "on" : "off",
                std::string(one.name).c_str(), std::string(one.summary).c_str());
  }
  std::printf("\nisolation of workers: %s\n", sandbox_support().c_str());
  std::printf("\nauto takes %s: %s\n", gpu::device_name(choice.device).c_str(), choice.why.c_str());
}

void print_json(const std::vector<DeviceProbe>& probes, const gpu::AutoChoice& choice,
                const DoctorCommand& command, const Calibrated& calibrated) {
  json object = {{"version", version()}, {"devices", json::array()}};
  object["sandbox"] = sandbox_support();
  for (const DeviceProbe& probe : probes) {
    object["devices"].push_back(device_json(probe));
    if (probe.works) {
      object["devices"].back()["calibration"] = calibration_state(command.data_dir, probe.info);
      if (probe.device.kind != DeviceKind::kCpu) {
        object["devices"].back()["self_test"] = self_test_state(command.data_dir, probe.info);
      }
    }
  }
  if (calibrated) object["calibration"] = calibration_json(*calibrated);
  for (const gpu::WorkaroundInfo& one : gpu::all_workarounds()) {
    object["workarounds"][std::string(one.name)] = gpu::workaround_enabled(one.workaround);
  }
  object["auto"] = {{"device", gpu::device_name(choice.device)}, {"why", choice.why}};
  std::printf("%s\n", object.dump(2, ' ', false, json::error_handler_t::replace).c_str());
}

}  // namespace

int doctor_main(const std::string& self_executable, const DoctorCommand& command) {
  if (command.rebuild) return doctor_rebuild_main(command);
  if (command.store) return doctor_store_main(command);
  const std::vector<DeviceProbe> probes = gpu::probe_devices(
      {.executable = self_executable, .sandbox = command.sandbox, .compares_sandbox = true});
  const gpu::AutoChoice choice = gpu::choose_device(probes);
  Calibrated calibrated;
  if (command.calibrate) {
    const auto devices = devices_to_calibrate(command, probes);
    if (!devices) {
      std::fprintf(stderr, "voxeld: %s\n", devices.error().message().c_str());
      return kExitUsage;
    }
    for (const gpu::DeviceId& device : *devices) test_for_doctor(self_executable, command, device);
    calibrated = calibrate_devices(self_executable, *devices, command.data_dir);
  }
  if (command.json) {
    print_json(probes, choice, command, calibrated);
  } else {
    print_text(probes, choice, command);
    if (calibrated) print_calibration(*calibrated);
  }
  return calibration_status(calibrated);
}

}  // namespace voxeld
