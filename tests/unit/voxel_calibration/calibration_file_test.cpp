// The file of measurements: round trip, keys that no longer fit, and everything that can be broken.
#include "server/voxel/estimates/calibration.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

namespace voxeld {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

DeviceCalibration sample(const std::string& device) {
  return {device,
          {"a renderer", "4.5 a driver", "a processor", 2, 1},
          "2026-11-21",
          {{Pipeline::kCpu, {0.5, 0.25, 60, 3.5, 0.1}, {1, 2, 3, 4, 0.2}},
           {Pipeline::kRaster, {5, 0, 600, 35, 0.1}, {10, 20, 30, 40, 0.2}}}};
}

class CalibrationFile : public ::testing::Test {
 protected:
  CalibrationFile() {
    std::string pattern = (fs::temp_directory_path() / "voxeld-XXXXXX").string();
    dir_ = ::mkdtemp(pattern.data());
    path_ = dir_ / "data" / std::string(kCalibrationFileName);
  }
  ~CalibrationFile() override { fs::remove_all(dir_); }
  void write(const std::string& text) {
    fs::create_directories(path_.parent_path());
    std::ofstream(path_, std::ios::binary) << text;
  }
  fs::path dir_, path_;
};

TEST_F(CalibrationFile, written_calibrations_are_read_back) {
  ASSERT_TRUE(write_calibrations(path_, {sample("llvmpipe"), sample("cpu")}).ok());
  const auto read = read_calibrations(path_);
  ASSERT_TRUE(read.ok()) << read.error().message();
  ASSERT_EQ(read->size(), 2u);
  EXPECT_EQ((*read)[1].device, "cpu");
  EXPECT_EQ((*read)[0].key, sample("llvmpipe").key);
  EXPECT_EQ((*read)[0].date, "2026-11-21");
  EXPECT_EQ((*read)[0].model(Pipeline::kRaster, true)->tile_ms, 20);
  EXPECT_EQ((*read)[0].model(Pipeline::kCpu, false)->column_ns, 3.5);
  EXPECT_EQ((*read)[0].model(Pipeline::kCompute, false), nullptr);
  // Nothing else lies there: the temporary file has become the file.
  EXPECT_EQ(std::distance(fs::directory_iterator(path_.parent_path()), {}), 1);
}

TEST_F(CalibrationFile, a_file_that_is_not_there_has_no_devices) {
  const auto read = read_calibrations(path_);
  ASSERT_TRUE(read.ok());
  EXPECT_TRUE(read->empty());
  const auto lookup = find_calibration(path_, "cpu", sample("cpu").key);
  EXPECT_FALSE(lookup.found);
  EXPECT_FALSE(lookup.is_unreadable);
  EXPECT_EQ(lookup.why_not, "not calibrated");
}

TEST_F(CalibrationFile, measurements_count_for_the_same_device_driver_and_machine_alone) {
  ASSERT_TRUE(write_calibrations(path_, {sample("cpu"), sample("llvmpipe")}).ok());
  const CalibrationKey key = sample("cpu").key;
  EXPECT_TRUE(find_calibration(path_, "llvmpipe", key).found);
  EXPECT_EQ(find_calibration(path_, "egl:0", key).why_not, "not calibrated");
  const auto why_not = [&](auto change) {
    CalibrationKey other = key;
    change(other);
    const auto lookup = find_calibration(path_, "cpu", other);
    EXPECT_FALSE(lookup.found);
    return lookup.why_not;
  };
  EXPECT_EQ(why_not([](CalibrationKey& k) { k.renderer = "new"; }),
            "calibrated for another renderer: a renderer");
  EXPECT_EQ(why_not([](CalibrationKey& k) { k.driver = "4.6"; }),
            "calibrated for another driver: 4.5 a driver");
  EXPECT_EQ(why_not([](CalibrationKey& k) { k.cpu = "new"; }),
            "calibrated for another processor: a processor");
  EXPECT_EQ(why_not([](CalibrationKey& k) { k.threads = 64; }), "calibrated for 2 threads");
  EXPECT_EQ(why_not([](CalibrationKey& k) { k.algorithm_version = 2; }),
            "calibrated for an older version of the algorithms");
}

TEST_F(CalibrationFile, every_truncation_is_an_error_and_not_a_crash) {
  const std::string whole = calibrations_text({sample("cpu")});
  const size_t last = whole.find_last_of('}');
  for (size_t size = 0; size <= last; ++size) {
    EXPECT_FALSE(parse_calibrations(whole.substr(0, size)).ok()) << size;
  }
  EXPECT_TRUE(parse_calibrations(whole).ok());
}

TEST_F(CalibrationFile, errors_name_the_cause_and_the_place) {
  const json good = json::parse(calibrations_text({sample("cpu")}));
  const auto message = [&](const char* pointer, const json& value) {
    json bad = good;
    bad[json::json_pointer(pointer)] = value;
    const auto read = parse_calibrations(bad.dump());
    return read.ok() ? "accepted" : read.error().message();
  };
  EXPECT_EQ(message("/version", 2), "calibration.version: expected 1, got 2");
  EXPECT_EQ(message("/devices", 3), "calibration.devices: expected an array, got number");
  EXPECT_EQ(message("/devices/0", "x"), "calibration.devices[0]: expected member device, got none");
  EXPECT_EQ(message("/devices/0/key/threads", -2),
            "calibration.devices[0].key.threads: expected a number from 0 to 1e12, got -2");
  EXPECT_EQ(message("/devices/0/pipelines/1/pipeline", "cuda"),
            "calibration.devices[0].pipelines[1].pipeline: expected raster, compute or cpu, got "
            "cuda");
  EXPECT_EQ(message("/devices/0/pipelines/0/attributes/column_ns", nullptr),
            "calibration.devices[0].pipelines[0].attributes.column_ns: expected a number from 0 "
            "to 1e12, got null");
  EXPECT_EQ(message("/devices/0/pipelines/0/occupancy/job_ms", 1e300),
            "calibration.devices[0].pipelines[0].occupancy.job_ms: expected a number from 0 to "
            "1e12, got 1e+300");
  EXPECT_EQ(parse_calibrations("no json").error().message(),
            "calibration: expected JSON, got 7 bytes that are none");
}

TEST_F(CalibrationFile, a_broken_file_is_reported_with_its_name) {
  for (const std::string& text : {std::string("{\"version\":"), std::string(2 << 20, ' ')}) {
    write(text);
    const auto lookup = find_calibration(path_, "cpu", sample("cpu").key);
    EXPECT_FALSE(lookup.found);
    EXPECT_TRUE(lookup.is_unreadable);
    EXPECT_EQ(lookup.why_not.find(path_.string()), 0u) << lookup.why_not;
  }
  // A new calibration replaces it.
  ASSERT_TRUE(write_calibrations(path_, {sample("cpu")}).ok());
  EXPECT_TRUE(find_calibration(path_, "cpu", sample("cpu").key).found);
}

TEST_F(CalibrationFile, a_folder_that_cannot_be_made_is_an_error) {
  write("");
  EXPECT_FALSE(write_calibrations(path_ / "below" / "file", {}).ok());
}

}  // namespace
}  // namespace voxeld
