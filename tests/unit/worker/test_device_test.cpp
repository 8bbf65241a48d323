// Self-tests by children that agree, differ, crash and hang as drivers do, and their record.
#include "server/worker/device/test_device.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "server/base/algorithm_version.h"
#include "tests/unit/base/comes_true.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

const gpu::DeviceId kGpu{gpu::DeviceKind::kEgl, 0};
const SelfTestKey kKey{"a GPU", "driver 1", "sha256-1", kAlgorithmVersion};

class TestDevice : public ::testing::Test {
 protected:
  // A shell script that plays the part of `voxeld test-device …`.
  SelfTestReport run(const std::string& body,
                     std::chrono::milliseconds timeout = testing::kPatience) {
    const fs::path script = dir_.path() / "child";
    std::ofstream(script)
        << "#!/bin/sh\necho $* >>" << log_.string()
        << "\necho driver noise\necho '{\"key\":[\"a GPU\",\"driver 1\",\"sha256-1\"]}'\n"
        << body << "\n";
    ::chmod(script.c_str(), 0700);
    return test_device({.executable = script.string(),
                        .sandbox = "require",
                        .data_dir = dir_.path() / "data",
                        .timeout_each = timeout},
                       kGpu);
  }
  std::string asked() const {
    std::ifstream file(log_);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  SelfTestLookup kept() const { return find_self_test(dir_.path() / "data", "egl:0", kKey); }

  testing::TemporaryDir dir_;
  fs::path log_ = dir_.path() / "log";
};

TEST_F(TestDevice, an_outcome_is_kept_for_its_driver_and_shaders) {
  EXPECT_EQ(kept().why_not, "not tested");
  const auto report = run(R"(echo '{"part":"compute","step":"touch"}'
echo '{"faults":{"raster":"thin: 3 voxels, 4 on the CPU"}}')");
  EXPECT_EQ(report.failure, "");
  EXPECT_EQ(report.warning, "");
  EXPECT_FALSE(report.was_known);
  EXPECT_EQ(report.faults.text(), "raster: thin: 3 voxels, 4 on the CPU");
  EXPECT_EQ(asked(), "test-device --device egl:0 --sandbox require --data " +
                         (dir_.path() / "data").string() + "\n");
  EXPECT_TRUE(kept().found);
  EXPECT_EQ(kept().faults, report.faults);
  SelfTestKey other = kKey;
  other.driver = "driver 2";
  EXPECT_EQ(find_self_test(dir_.path() / "data", "egl:0", other).why_not,
            "tested with another driver: driver 1");
  other = kKey;
  other.shaders = "sha256-2";
  EXPECT_EQ(find_self_test(dir_.path() / "data", "egl:0", other).why_not,
            "tested with the shaders of another version");
  gpu::DeviceInfo info;
  info.device = kGpu;
  info.renderer = "a GPU";
  info.version = "driver 1";
  EXPECT_EQ(self_test_state(dir_.path() / "data", info),
            "differs from the CPU: raster: thin: 3 voxels, 4 on the CPU");
}

TEST_F(TestDevice, a_known_outcome_is_read) {
  DeviceFaults faults;
  faults.add(DevicePart::kImages, "voxel: other colours");
  ASSERT_TRUE(keep_self_test(dir_.path() / "data", {"egl:0", kKey, faults}));
  const auto report = run(R"(echo '{"known":true}')");
  EXPECT_TRUE(report.was_known);
  EXPECT_EQ(report.faults, faults);
}

TEST_F(TestDevice, a_device_that_lacked_memory_is_tested_again_at_the_next_start) {
  const std::string lacked = R"(echo '{"faults":{"solid":"flood: GL_OUT_OF_MEMORY on egl:0 )"
                             R"((a GPU): out of device memory"}}')";
  EXPECT_THAT(run(lacked).faults.why(DevicePart::kSolid), HasSubstr("out of device memory"));
  EXPECT_TRUE(kept().faults.has(DevicePart::kSolid));
  const auto report = run(R"(case "$*" in
*--data*) echo '{"known":true}';;
*) echo '{"faults":{}}';;
esac)");
  EXPECT_FALSE(report.was_known);
  EXPECT_FALSE(report.faults.any());
  EXPECT_TRUE(kept().found);
  EXPECT_FALSE(kept().faults.any());
  EXPECT_TRUE(run(R"(echo '{"known":true}')").was_known);
  const std::string test = "test-device --device egl:0 --sandbox require";
  const std::string data = " --data " + (dir_.path() / "data").string();
  EXPECT_EQ(asked(), test + data + "\n" + test + "\n" + test + data + "\n");
}

TEST_F(TestDevice, a_crash_is_a_fault_of_the_step_and_the_other_parts_are_tested) {
  const auto report = run(R"(case "$*" in
*--skip*) echo '{"faults":{"images":"voxel: other colours"}}';;
*) echo '{"part":"compute","step":"touch"}'; echo '{"part":"solid","step":"flood"}'; kill -SEGV $$;;
esac)");
  EXPECT_EQ(report.failure, "");
  EXPECT_EQ(report.faults.why(DevicePart::kSolid), "flood: the driver crashed: Segmentation fault");
  EXPECT_EQ(report.faults.why(DevicePart::kImages), "voxel: other colours");
  EXPECT_THAT(asked(), HasSubstr("--skip solid\n"));
  EXPECT_EQ(kept().faults, report.faults);
}

// On a busy machine the child may be ended before its step, or the next one before its reply: then
// both get more time.
TEST_F(TestDevice, a_hang_is_a_fault_of_the_step) {
  for (std::chrono::milliseconds timeout{300};; timeout *= 2) {
    ASSERT_LT(timeout, testing::kPatience) << "a shell starts in less";
    const auto report = run(R"(case "$*" in
*--skip*) echo '{"faults":{}}';;
*) echo '{"part":"raster","step":"touch"}'; exec sleep 600;;
esac)",
                            timeout);
    const std::string late =
        "the driver did not reply within " + std::to_string(timeout.count()) + " ms";
    if (report.failure == late) continue;
    EXPECT_EQ(report.failure, "");
    EXPECT_EQ(report.faults.text(), "raster: touch: " + late);
    return;
  }
}

TEST_F(TestDevice, a_child_that_ends_a_hung_step_says_so) {
  const auto report = run(R"(case "$*" in
*--skip*) echo '{"faults":{}}';;
*) echo '{"part":"raster","step":"touch"}'; echo '{"hung":true}';;
esac)");
  EXPECT_THAT(report.faults.text(),
              ::testing::MatchesRegex("raster: touch: no end after [0-9]+ s"));
}

TEST_F(TestDevice, a_device_that_another_process_has_reset_is_tested_once_more) {
  const auto report = run("if [ $(wc -l <" + log_.string() + R"() -eq 1 ]; then echo '{"lost":true}'
echo '{"faults":{"images":"voxel: the device was reset"}}'; else echo '{"faults":{}}'; fi)");
  EXPECT_EQ(report.failure, "");
  EXPECT_EQ(report.faults.text(), "");
  EXPECT_TRUE(kept().found);
  EXPECT_FALSE(kept().faults.any());
}

TEST_F(TestDevice, a_device_that_resets_each_time_has_the_faults) {
  const auto report = run(R"(echo '{"lost":true}'
echo '{"faults":{"images":"voxel: the device was reset"}}')");
  EXPECT_EQ(report.failure, "");
  EXPECT_EQ(report.faults.text(), "images: voxel: the device was reset");
  EXPECT_EQ(kept().faults, report.faults);
}

TEST_F(TestDevice, a_device_that_does_not_open_has_no_outcome) {
  EXPECT_EQ(run(R"(echo '{"reason":"egl:0 does not exist"}')").failure, "egl:0 does not exist");
  EXPECT_EQ(run("kill -SEGV $$").failure, "the driver crashed: Segmentation fault");
  EXPECT_EQ(run("").failure, "the self-test gave no reply");
  EXPECT_FALSE(kept().found);
}

TEST(SelfTestRecord, a_file_that_is_none_is_named_and_replaced) {
  const testing::TemporaryDir dir;
  for (const char* text : {"", "[]", "{}", R"({"version":1})", R"({"version":2,"devices":[]})",
                           R"({"version":1,"devices":[{"device":1}]})",
                           R"({"version":1,"devices":[{"device":"egl:0","key":{}}]})"}) {
    EXPECT_FALSE(parse_self_tests(text)) << text;
  }
  std::ofstream(dir.path() / kSelfTestFileName) << "{";
  EXPECT_THAT(find_self_test(dir.path(), "egl:0", kKey).why_not,
              HasSubstr((dir.path() / kSelfTestFileName).string()));
  ASSERT_TRUE(keep_self_test(dir.path(), {"egl:0", kKey, {}}));
  ASSERT_TRUE(keep_self_test(dir.path(), {"egl:1", kKey, {}}));
  EXPECT_TRUE(find_self_test(dir.path(), "egl:0", kKey).found);
  EXPECT_TRUE(find_self_test(dir.path(), "egl:1", kKey).found);
}

TEST(SelfTestRecord, what_was_written_is_read) {
  DeviceFaults faults;
  faults.add(DevicePart::kCompute, "touch: \"quoted\"");
  faults.add(DevicePart::kSolid, std::string(5000, 'x'));
  const auto read = parse_self_tests(self_tests_text({{"egl:0", kKey, faults}}));
  ASSERT_TRUE(read);
  ASSERT_EQ(read->size(), 1u);
  EXPECT_EQ((*read)[0].device, "egl:0");
  EXPECT_EQ((*read)[0].key, kKey);
  EXPECT_EQ((*read)[0].faults.why(DevicePart::kCompute), "touch: \"quoted\"");
  EXPECT_EQ((*read)[0].faults.why(DevicePart::kSolid).size(), kFaultBytesMax);
}

}  // namespace
}  // namespace voxeld
