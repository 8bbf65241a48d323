// The calibration of a device's pipelines, and the file that stores it.
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
// The file has one entry for each device; a new measurement of the device replaces it.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/voxel/estimates/cost_model.h"
#include "server/voxel/estimates/pipeline.h"

namespace voxeld {

inline constexpr int kCalibrationVersion = 1;
// The file's name in the data directory.
inline constexpr std::string_view kCalibrationFileName = "calibration.json";
// Larger files are rejected unread: no calibration file gets near this size.
inline constexpr size_t kCalibrationBytesMax = size_t{1} << 20;

// A calibration is valid only while these match.
struct CalibrationKey {
  std::string renderer, driver;  // as the driver gives them
  std::string cpu;               // cpu_model()
  int threads = 0;               // cpu_thread_count()
  int algorithm_version = 0;
  bool operator==(const CalibrationKey&) const = default;
};

struct PipelineCosts {
  Pipeline pipeline = Pipeline::kCpu;
  CostModel occupancy;   // for grids without colours and normals
  CostModel attributes;  // for grids with colours or normals
};

struct DeviceCalibration {
  std::string device;  // "egl:0", "cpu"
  CalibrationKey key;
  std::string date;  // "2026-11-21", UTC
  std::vector<PipelineCosts> pipelines;

  // Null if the pipeline was not measured.
  const CostModel* model(Pipeline pipeline, bool attributes) const;
};

// Readers and writers of the format above. Errors: internal, with the fault, its place, and the
// expected and actual value.
Result<std::vector<DeviceCalibration>> parse_calibrations(std::string_view text);
Result<DeviceCalibration> parse_calibration(std::string_view text);
std::string calibrations_text(const std::vector<DeviceCalibration>& devices);
std::string calibration_text(const DeviceCalibration& device);

// A missing file is an empty list. Errors: as parse_calibrations(), naming the file.
Result<std::vector<DeviceCalibration>> read_calibrations(const std::filesystem::path& path);
// Replaces the file atomically: readers see the old or the new one. Creates the folder.
Status write_calibrations(const std::filesystem::path& path,
                          const std::vector<DeviceCalibration>& devices);

// The calibration of a device, or the reason why there is no valid one.
struct CalibrationLookup {
  bool found = false;
  DeviceCalibration calibration;
  bool is_unreadable = false;  // the file exists but does not parse
  std::string why_not;  // "not calibrated", "calibrated for another driver", the file's error
};
CalibrationLookup find_calibration(const std::filesystem::path& path, const std::string& device,
                                   const CalibrationKey& key);

}  // namespace voxeld
