#include "server/voxel/estimates/calibration.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>

#include "server/base/disk/file.h"
#include "server/base/disk/replace_file.h"

namespace voxeld {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

// A format error in a calibration file. It is thrown only within this file; the parse functions
// catch it.
struct Malformed {
  std::string where, expected, got;
};

const json& member(const json& object, const char* name, const std::string& where) {
  if (!object.is_object() || !object.contains(name)) {
    throw Malformed{where, std::string("member ") + name, "none"};
  }
  return object.at(name);
}

std::string text_member(const json& object, const char* name, const std::string& where) {
  const json& value = member(object, name, where);
  if (!value.is_string()) throw Malformed{where + "." + name, "a string", value.type_name()};
  return value.get<std::string>();
}

double number_member(const json& object, const char* name, const std::string& where) {
  const json& value = member(object, name, where);
  const double number = value.is_number() ? value.get<double>() : -1;
  if (!(number >= 0) || number > 1e12) {
    throw Malformed{where + "." + name, "a number from 0 to 1e12", value.dump().substr(0, 40)};
  }
  return number;
}

const json& array_member(const json& object, const char* name, const std::string& where) {
  const json& value = member(object, name, where);
  if (!value.is_array()) throw Malformed{where + "." + name, "an array", value.type_name()};
  return value;
}

Pipeline pipeline_from(const std::string& name, const std::string& where) {
  for (const Pipeline one : {Pipeline::kRaster, Pipeline::kCompute, Pipeline::kCpu}) {
    if (pipeline_name(one) == name) return one;
  }
  throw Malformed{where + ".pipeline", "raster, compute or cpu", name.substr(0, 40)};
}

CostModel model_from(const json& object, const std::string& where) {
  return {number_member(object, "job_ms", where), number_member(object, "tile_ms", where),
          number_member(object, "triangle_ns", where), number_member(object, "column_ns", where),
          number_member(object, "error", where)};
}

json model_json(const CostModel& model) {
  return {{"job_ms", model.job_ms},
          {"tile_ms", model.tile_ms},
          {"triangle_ns", model.triangle_ns},
          {"column_ns", model.column_ns},
          {"error", model.error}};
}

DeviceCalibration device_from(const json& object, const std::string& where) {
  DeviceCalibration device;
  device.device = text_member(object, "device", where);
  device.date = text_member(object, "date", where);
  const json& key = member(object, "key", where);
  const std::string in_key = where + ".key";
  device.key.renderer = text_member(key, "renderer", in_key);
  device.key.driver = text_member(key, "driver", in_key);
  device.key.cpu = text_member(key, "cpu", in_key);
  device.key.threads = static_cast<int>(std::min(1e6, number_member(key, "threads", in_key)));
  device.key.algorithm_version =
      static_cast<int>(std::min(1e6, number_member(key, "algorithm_version", in_key)));
  for (const json& one : array_member(object, "pipelines", where)) {
    const std::string in_pipeline =
        where + ".pipelines[" + std::to_string(device.pipelines.size()) + "]";
    PipelineCosts costs;
    costs.pipeline = pipeline_from(text_member(one, "pipeline", in_pipeline), in_pipeline);
    costs.occupancy = model_from(member(one, "occupancy", in_pipeline), in_pipeline + ".occupancy");
    costs.attributes =
        model_from(member(one, "attributes", in_pipeline), in_pipeline + ".attributes");
    device.pipelines.push_back(costs);
  }
  return device;
}

json device_json(const DeviceCalibration& device) {
  const CalibrationKey& key = device.key;
  json pipelines = json::array();
  for (const PipelineCosts& costs : device.pipelines) {
    pipelines.push_back({{"pipeline", pipeline_name(costs.pipeline)},
                         {"occupancy", model_json(costs.occupancy)},
                         {"attributes", model_json(costs.attributes)}});
  }
  return {{"device", device.device},
          {"key",
           {{"renderer", key.renderer},
            {"driver", key.driver},
            {"cpu", key.cpu},
            {"threads", key.threads},
            {"algorithm_version", key.algorithm_version}}},
          {"date", device.date},
          {"pipelines", pipelines}};
}

// Parses text, calls read(json) and turns a thrown Malformed into an error.
template <typename Read>
auto parse_with(std::string_view text, const Read& read) -> Result<decltype(read(json()))> {
  const json object = json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (object.is_discarded()) {
    return Error{ErrorCode::kInternal, "calibration", "JSON",
                 std::to_string(text.size()) + " bytes that are none"};
  }
  try {
    return read(object);
  } catch (const Malformed& bad) {
    return Error{ErrorCode::kInternal, bad.where, bad.expected, bad.got};
  }
}

std::vector<DeviceCalibration> devices_from(const json& object) {
  const std::string where = "calibration";
  const double version = number_member(object, "version", where);
  if (version != kCalibrationVersion) {
    throw Malformed{where + ".version", std::to_string(kCalibrationVersion),
                    std::to_string(static_cast<int64_t>(version))};
  }
  std::vector<DeviceCalibration> devices;
  for (const json& one : array_member(object, "devices", where)) {
    devices.push_back(device_from(one, where + ".devices[" + std::to_string(devices.size()) + "]"));
  }
  return devices;
}

// The first member that differs, as words for an error message.
std::string difference(const CalibrationKey& was, const CalibrationKey& is) {
  if (was.renderer != is.renderer) return "another renderer: " + was.renderer;
  if (was.driver != is.driver) return "another driver: " + was.driver;
  if (was.cpu != is.cpu) return "another processor: " + was.cpu;
  if (was.threads != is.threads) return std::to_string(was.threads) + " threads";
  return "an older version of the algorithms";
}

}  // namespace

const CostModel* DeviceCalibration::model(Pipeline pipeline, bool attributes) const {
  for (const PipelineCosts& costs : pipelines) {
    if (costs.pipeline == pipeline) return attributes ? &costs.attributes : &costs.occupancy;
  }
  return nullptr;
}

Result<std::vector<DeviceCalibration>> parse_calibrations(std::string_view text) {
  return parse_with(text, [](const json& object) { return devices_from(object); });
}

Result<DeviceCalibration> parse_calibration(std::string_view text) {
  return parse_with(text, [](const json& object) { return device_from(object, "device"); });
}

std::string calibrations_text(const std::vector<DeviceCalibration>& devices) {
  json list = json::array();
  for (const DeviceCalibration& device : devices) list.push_back(device_json(device));
  const json object = {{"version", kCalibrationVersion}, {"devices", list}};
  return object.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

std::string calibration_text(const DeviceCalibration& device) {
  return device_json(device).dump(-1, ' ', false, json::error_handler_t::replace);
}

Result<std::vector<DeviceCalibration>> read_calibrations(const fs::path& path) {
  std::error_code failed;
  if (!fs::exists(path, failed)) return std::vector<DeviceCalibration>();
  const auto bytes_on_disk = fs::file_size(path, failed);
  if (!failed && bytes_on_disk > kCalibrationBytesMax) {
    return Error{ErrorCode::kInternal, path.string(),
                 "at most " + std::to_string(kCalibrationBytesMax) + " bytes",
                 std::to_string(bytes_on_disk)};
  }
  VOXELD_ASSIGN(const std::vector<uint8_t> bytes, read_file(path));
  auto devices = parse_calibrations({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  if (devices) return devices;
  Error error = devices.error();
  error.detail = path.string() + ": " + error.detail;
  return error;
}

Status write_calibrations(const fs::path& path, const std::vector<DeviceCalibration>& devices) {
  return replace_file(path, calibrations_text(devices));
}

CalibrationLookup find_calibration(const fs::path& path, const std::string& device,
                                   const CalibrationKey& key) {
  const auto devices = read_calibrations(path);
  if (!devices) return {false, {}, true, devices.error().message()};
  std::string why_not = "not calibrated";
  for (const DeviceCalibration& one : *devices) {
    if (one.device != device) continue;
    if (one.key == key) return {true, one, false, ""};
    why_not = "calibrated for " + difference(one.key, key);
  }
  return {false, {}, false, why_not};
}

}  // namespace voxeld
