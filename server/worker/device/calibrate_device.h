// `voxeld doctor --calibrate`: measures devices and stores the results in the data directory.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/device/device.h"

namespace voxeld {

// Measures one device's pipelines, in a child process, and prints the calibration as one line of
// JSON, or {"reason": …}. Returns the exit status, which is 0 also if the device does not open.
int calibrate_device_main(const gpu::DeviceId& device);

struct CalibratedDevice {
  std::string device;
  std::string failure;  // why there is no calibration; otherwise empty
  std::string date;
  // A line of the table for each pipeline and kind of grid.
  std::vector<std::string> rows;
};

// Measures each device in a child process (`self_executable` calibrate-device …), one after the
// other, and replaces its entry in data_dir/calibration.json. Entries of other devices stay. An
// unreadable file is replaced, and `warning` says so. Errors: those of writing the file.
struct CalibrationReport {
  std::filesystem::path path;
  std::string warning;
  std::vector<CalibratedDevice> devices;
};
Result<CalibrationReport> calibrate_devices(const std::string& self_executable,
                                            const std::vector<gpu::DeviceId>& devices,
                                            const std::filesystem::path& data_dir);

// The calibration that a worker on this device would use: "calibrated 2026-11-21", or why there is
// none.
std::string calibration_state(const std::filesystem::path& data_dir, const gpu::DeviceInfo& info);

// The header of the table.
std::string calibration_table_head();

}  // namespace voxeld
