// Measurements of a device's pipelines, and the file that keeps them.
//
//   {"version": 1,
//    "devices": [{"device": "llvmpipe",
//                 "key": {"renderer": …, "driver": …, "cpu": …, "threads": 2,
//                         "algorithm_version": 1},
//                 "date": "2026-11-21",
//                 "pipelines": [{"pipeline": "cpu",
//                                "occupancy": {"job_ms": …, "tile_ms": …, "triangle_ns": …,
//                                              "column_ns": …, "error": …},
//                                "attributes": {…}}, …]}, …]}
//
// One entry for each device; a new measurement of the device replaces it.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/voxel/cost_model.h"
#include "server/voxel/pipeline.h"

namespace voxeld {

inline constexpr int kCalibrationVersion = 1;
// In the data directory.
inline constexpr std::string_view kCalibrationFileName = "calibration.json";
// A file above this is not read: it is none of ours.
inline constexpr size_t kCalibrationBytesMax = size_t{1} << 20;

// What must be as it was, so that measurements still tell.
struct CalibrationKey {
  std::string renderer, driver;  // as the driver gives them
  std::string cpu;               // cpu_model()
  int threads = 0;               // cpu_thread_count()
  int algorithm_version = 0;
  bool operator==(const CalibrationKey&) const = default;
};

struct PipelineCosts {
  Pipeline pipeline = Pipeline::kCpu;
  CostModel occupancy;   // of grids without colours and normals
  CostModel attributes;  // of grids with them
};

struct DeviceCalibration {
  std::string device;  // "egl:0", "cpu"
  CalibrationKey key;
  std::string date;  // "2026-11-21", UTC
  std::vector<PipelineCosts> pipelines;

  // Null where the pipeline was not measured.
  const CostModel* model(Pipeline pipeline, bool attributes) const;
};

// As above. Errors: internal with what is wrong, where, expected and got.
Result<std::vector<DeviceCalibration>> parse_calibrations(std::string_view text);
Result<DeviceCalibration> parse_calibration(std::string_view text);
std::string calibrations_text(const std::vector<DeviceCalibration>& devices);
std::string calibration_text(const DeviceCalibration& device);

// A file that does not exist has no devices. Errors: as parse_calibrations(), naming the file.
Result<std::vector<DeviceCalibration>> read_calibrations(const std::filesystem::path& path);
// Replaces the file in one step: readers see the old or the new one. Makes the folder.
Status write_calibrations(const std::filesystem::path& path,
                          const std::vector<DeviceCalibration>& devices);

// Of a device: its measurements, or why there are none that tell.
struct CalibrationLookup {
  bool found = false;
  DeviceCalibration calibration;
  bool is_unreadable = false;  // the file is broken
  std::string why_not;  // "not calibrated", "calibrated for another driver", the file's error
};
CalibrationLookup find_calibration(const std::filesystem::path& path, const std::string& device,
                                   const CalibrationKey& key);

}  // namespace voxeld
