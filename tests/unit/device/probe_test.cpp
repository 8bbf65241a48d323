// probe_devices() against programs that reply, crash, hang and print noise as drivers do.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "server/device/auto_device.h"
#include "server/device/device.h"

namespace voxeld::gpu {
namespace {

// A shell script that plays the part of `voxeld probe-device --device NAME --sandbox MODE`; $3 is
// NAME, $5 MODE.
class FakeProbe {
 public:
  explicit FakeProbe(const std::string& body) {
    std::string pattern = (std::filesystem::temp_directory_path() / "voxeld-XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
    std::ofstream(path()) << "#!/bin/sh\n" << body;
    ::chmod(path().c_str(), 0700);
  }
  ~FakeProbe() { std::filesystem::remove_all(folder_); }
  std::string path() const { return (folder_ / "probe").string(); }

 private:
  std::filesystem::path folder_;
};

TEST(ProbeDevices, asks_for_as_many_egl_devices_as_there_are_then_the_software_drivers) {
  const FakeProbe fake(R"(echo driver noise
echo '{"works":true,"egl_device_count":2,"context_ms":1.5,"info":{"renderer":"'$3'"}}')");
  const auto probes = probe_devices({.executable = fake.path()});
  ASSERT_EQ(probes.size(), 6u);
  const char* names[] = {"egl:0", "egl:1", "llvmpipe", "lavapipe", "osmesa"};
  for (size_t i = 0; i < 5; ++i) {
    EXPECT_TRUE(probes[i].works) << probes[i].reason;
    EXPECT_EQ(device_name(probes[i].device), names[i]);
    EXPECT_EQ(probes[i].info.renderer, names[i]);
    EXPECT_EQ(probes[i].info.device, probes[i].device);
    EXPECT_EQ(probes[i].context_ms, 1.5);
  }
  EXPECT_TRUE(probes[5].works);
  EXPECT_EQ(device_name(probes[5].device), "cpu");
  EXPECT_FALSE(probes[5].info.renderer.empty());
}

TEST(ProbeDevices, a_machine_without_egl_keeps_egl_0_with_its_reason) {
  const FakeProbe fake(R"(echo '{"works":false,"egl_device_count":0,"reason":"no libEGL"}')");
  const auto probes = probe_devices({.executable = fake.path()});
  ASSERT_EQ(probes.size(), 5u);
  EXPECT_FALSE(probes[0].works);
  EXPECT_EQ(probes[0].reason, "no libEGL");
}

TEST(ProbeDevices, a_driver_that_crashes_ends_only_its_child) {
  const FakeProbe fake(R"(case $3 in
egl:*) echo '{"works":false,"egl_device_count":0,"reason":"none"}';;
llvmpipe) kill -SEGV $$;;
lavapipe) exit 7;;
*) echo 'no json';;
esac)");
  const auto probes = probe_devices({.executable = fake.path()});
  ASSERT_EQ(probes.size(), 5u);
  EXPECT_EQ(probes[1].reason, "llvmpipe: the driver crashed: Segmentation fault");
  EXPECT_EQ(probes[2].reason, "lavapipe: the probe ended with status 7");
  EXPECT_EQ(probes[3].reason, "osmesa: the probe gave no reply");
}

TEST(ProbeDevices, a_driver_that_crashes_after_its_reply_does_not_work) {
  const FakeProbe fake(R"(echo '{"works":true,"egl_device_count":0,"info":{}}'; kill -ABRT $$)");
  const auto probes = probe_devices({.executable = fake.path()});
  EXPECT_FALSE(probes[0].works);
  EXPECT_EQ(probes[0].reason, "egl:0: the driver crashed: Aborted");
}

TEST(ProbeDevices, a_driver_that_hangs_is_killed) {
  const FakeProbe fake("exec sleep 60");
  const auto probes =
      probe_devices({.executable = fake.path(), .timeout_each = std::chrono::milliseconds(50)});
  ASSERT_GE(probes.size(), 4u);
  EXPECT_EQ(probes[0].reason, "egl:0: the driver did not reply within 50 ms");
}

TEST(ProbeDevices, a_program_that_cannot_be_run_is_reported) {
  const auto probes = probe_devices({.executable = "/nonexistent/voxeld"});
  ASSERT_GE(probes.size(), 4u);
  EXPECT_EQ(probes[0].reason, "egl:0: cannot run /nonexistent/voxeld: No such file or directory");
}

TEST(ProbeDevices, a_reply_of_the_wrong_types_is_not_understood) {
  const FakeProbe fake(R"(echo '{"works":"perhaps","egl_device_count":0}')");
  const auto probes = probe_devices({.executable = fake.path()});
  EXPECT_FALSE(probes[0].works);
  EXPECT_NE(probes[0].reason.find("the probe's reply is not understood"), std::string::npos);
}

TEST(ProbeDevices, a_device_that_only_the_sandbox_keeps_out_is_told_apart) {
  const FakeProbe fake(R"(case $3$5 in
egl:0off) echo '{"works":true,"egl_device_count":1,"info":{"renderer":"a GPU"}}';;
egl:0*) echo '{"works":false,"egl_device_count":0,"reason":"egl:0 does not exist"}';;
*) echo '{"works":false,"reason":"no driver"}';;
esac)");
  const auto compared = probe_devices({.executable = fake.path(), .compares_sandbox = true});
  ASSERT_EQ(compared.size(), 5u);
  EXPECT_FALSE(compared[0].works);
  EXPECT_TRUE(compared[0].is_kept_out);
  EXPECT_EQ(compared[0].reason,
            "egl:0 does not exist; outside of the sandbox it opens, as a GPU: the sandbox of "
            "workers keeps a file or system call from the driver");
  EXPECT_FALSE(compared[1].is_kept_out);
  EXPECT_EQ(compared[1].reason, "no driver");
  EXPECT_FALSE(probe_devices({.executable = fake.path()})[0].is_kept_out);
  EXPECT_TRUE(probe_devices({.executable = fake.path(), .sandbox = "off"})[0].works);
}

TEST(ProbeAutoDevice, the_choice_names_a_device_that_the_sandbox_keeps_out) {
  const FakeProbe fake(R"(case $3$5 in
egl:0off) echo '{"works":true,"egl_device_count":1,"info":{"renderer":"a GPU"}}';;
llvmpipe*) echo '{"works":true,"info":{"renderer":"llvmpipe","is_software":true}}';;
*) echo '{"works":false,"egl_device_count":1,"reason":"no driver"}';;
esac)");
  const AutoChoice choice =
      probe_auto_device({.executable = fake.path(), .compares_sandbox = true});
  EXPECT_EQ(device_name(choice.device), "llvmpipe");
  EXPECT_EQ(
      choice.why,
      "no hardware device works; llvmpipe is the fastest software driver that does: llvmpipe; "
      "egl:0 opens outside of the workers' sandbox alone: `voxeld doctor` tells more");
}

// Which devices the fake was asked for, one to a line.
class CountedProbe {
 public:
  explicit CountedProbe(const std::string& cases)
      : log_(std::filesystem::temp_directory_path() / ("probes-" + std::to_string(::getpid()))),
        fake_("echo $3 >>" + log_.string() + "\ncase $3 in\n" + cases + "\nesac") {}
  ~CountedProbe() { std::filesystem::remove(log_); }
  AutoChoice choose() const { return probe_auto_device({.executable = fake_.path()}); }
  std::string asked() const {
    std::ifstream file(log_);
    return {std::istreambuf_iterator<char>(file), {}};
  }

 private:
  std::filesystem::path log_;
  FakeProbe fake_;
};

TEST(ProbeAutoDevice, hardware_is_chosen_without_further_probes) {
  const CountedProbe fake(
      R"(egl:0) echo '{"works":true,"egl_device_count":3,"info":{"is_software":true}}';;
egl:1) echo '{"works":true,"egl_device_count":3,"info":{"renderer":"a GPU"}}';;)");
  EXPECT_EQ(device_name(fake.choose().device), "egl:1");
  EXPECT_EQ(fake.asked(), "egl:0\negl:1\n");
}

TEST(ProbeAutoDevice, the_first_software_driver_that_works_is_chosen_without_further_probes) {
  const CountedProbe fake(
      R"(egl:0) echo '{"works":false,"egl_device_count":0,"reason":"none"}';;
llvmpipe) exit 7;;
lavapipe) echo '{"works":true,"info":{"renderer":"lavapipe","is_software":true}}';;)");
  EXPECT_EQ(device_name(fake.choose().device), "lavapipe");
  EXPECT_EQ(fake.asked(), "egl:0\nllvmpipe\nlavapipe\n");
}

TEST(ProbeAutoDevice, without_a_driver_everything_runs_on_the_cpu) {
  const CountedProbe fake(
      R"(*) echo '{"works":false,"egl_device_count":0,"reason":"no driver"}';;)");
  const AutoChoice choice = fake.choose();
  EXPECT_EQ(device_name(choice.device), "cpu");
  EXPECT_EQ(choice.why, "no OpenGL device works, so everything runs on the CPU: no driver");
  EXPECT_EQ(fake.asked(), "egl:0\nllvmpipe\nlavapipe\nosmesa\n");
}

}  // namespace
}  // namespace voxeld::gpu
