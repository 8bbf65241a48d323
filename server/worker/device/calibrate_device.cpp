#include "server/worker/device/calibrate_device.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/process/child_process.h"
#include "server/voxel/calibrate.h"
#include "server/worker/device/calibration_key.h"
#include "server/worker/device/open_device.h"

namespace voxeld {
namespace {

using nlohmann::json;

// A driver that compiles slowly on a busy machine needs some 20 seconds; this is far more.
constexpr auto kChildTimeout = std::chrono::seconds(180);

std::string today() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  char text[16];
  std::strftime(text, sizeof text, "%Y-%m-%d", &utc);
  return text;
}

Result<DeviceCalibration> calibrate(const gpu::DeviceId& device) {
  VOXELD_ASSIGN(OpenedDevice opened, open_device(device, ""));
  std::vector<Pipeline> pipelines = {Pipeline::kCpu};
  if (opened.pipeline != nullptr) {
    pipelines.insert(pipelines.end(), {Pipeline::kCompute, Pipeline::kRaster});
  }
  const CalibrationKey key = calibration_key(opened.info);
  Voxelizer voxelizer(std::move(opened.pipeline));
  VOXELD_ASSIGN(const auto measurements, measure_pipelines(voxelizer, pipelines));
  VOXELD_ASSIGN(auto costs, fit_pipelines(measurements));
  return DeviceCalibration{gpu::device_name(device), key, today(), std::move(costs)};
}

std::string table_row(Pipeline pipeline, const char* kind, const CostModel& model) {
  char text[160];
  std::snprintf(text, sizeof text, "%-8s %-10s %9.3f %9.3f %12.1f %11.2f %6.0f%%",
                std::string(pipeline_name(pipeline)).c_str(), kind, model.job_ms, model.tile_ms,
                model.triangle_ns, model.column_ns, 100 * model.error);
  return text;
}

CalibratedDevice in_table(const DeviceCalibration& calibration) {
  CalibratedDevice device{calibration.device, "", calibration.date, {}};
  for (const PipelineCosts& costs : calibration.pipelines) {
    device.rows.push_back(table_row(costs.pipeline, "occupancy", costs.occupancy));
    device.rows.push_back(table_row(costs.pipeline, "attributes", costs.attributes));
  }
  return device;
}

// Measures in a child process. Errors: device-unavailable with the child's reason.
Result<DeviceCalibration> calibrate_in_child(const std::string& self_executable,
                                             const std::string& device) {
  const ChildReply reply =
      run_child({self_executable, "calibrate-device", "--device", device}, kChildTimeout);
  const std::string_view line = last_json_line(reply.text);
  const json object = json::parse(line, nullptr, /*allow_exceptions=*/false);
  std::string reason = reply.failure;
  if (object.is_object() && object.contains("reason") && object["reason"].is_string()) {
    reason = object["reason"].get<std::string>();
  }
  if (reason.empty()) return parse_calibration(line);
  return Error{ErrorCode::kDeviceUnavailable, reason, "", ""};
}

void replace_entry(std::vector<DeviceCalibration>& entries, DeviceCalibration calibration) {
  std::erase_if(entries, [&](const auto& one) { return one.device == calibration.device; });
  entries.push_back(std::move(calibration));
}

}  // namespace

int calibrate_device_main(const gpu::DeviceId& device) {
  const auto calibration = calibrate(device);
  const std::string line = calibration ? calibration_text(*calibration)
                                       : json{{"reason", calibration.error().message()}}.dump(
                                             -1, ' ', false, json::error_handler_t::replace);
  std::printf("\n%s\n", line.c_str());
  std::fflush(stdout);
  return 0;
}

Result<CalibrationReport> calibrate_devices(const std::string& self_executable,
                                            const std::vector<gpu::DeviceId>& devices,
                                            const std::filesystem::path& data_dir) {
  CalibrationReport report{data_dir / kCalibrationFileName, "", {}};
  auto read = read_calibrations(report.path);
  if (!read) report.warning = read.error().message() + "; the file is replaced";
  std::vector<DeviceCalibration> entries =
      read ? std::move(*read) : std::vector<DeviceCalibration>();
  for (const gpu::DeviceId& device : devices) {
    const std::string name = gpu::device_name(device);
    auto calibration = calibrate_in_child(self_executable, name);
    if (!calibration) {
      report.devices.push_back({name, calibration.error().message(), "", {}});
      continue;
    }
    report.devices.push_back(in_table(*calibration));
    replace_entry(entries, *std::move(calibration));
    // Written after each device, so a later one that hangs does not lose the measurements.
    VOXELD_TRY(write_calibrations(report.path, entries));
  }
  return report;
}

std::string calibration_state(const std::filesystem::path& data_dir, const gpu::DeviceInfo& info) {
  const CalibrationLookup lookup = find_calibration(
      data_dir / kCalibrationFileName, gpu::device_name(info.device), calibration_key(info));
  return lookup.found ? "calibrated " + lookup.calibration.date : lookup.why_not;
}

std::string calibration_table_head() {
  return "pipeline grids      ms a job  ms a tile  ns a triangle ns a column  error";
}

}  // namespace voxeld
