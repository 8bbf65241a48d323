// The self-test of a device in a child process: a driver may crash or hang in any of its steps.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/device/device.h"
#include "server/voxel/pipelines/device_faults.h"
#include "server/worker/device/self_test_record.h"

namespace voxeld {

struct OpenedDevice;

SelfTestKey self_test_key(const OpenedDevice& device);

// The child. Prints lines of JSON: {"key": …}, {"known": true} or a {"part": …, "step": …} for each
// step and {"faults": …} at the end, before it {"lost": true} if the device was reset, or
// {"hung": true} when a step does not end; {"reason": …} if the device does not open.
struct SelfTestChild {
  gpu::DeviceId device;
  std::string shader_dir;
  std::filesystem::path data_dir;         // where known outcomes are; empty: test in any case
  std::vector<std::string> skipped;       // names of parts whose faults are known
  std::function<Status()> enter_sandbox;  // before the device is opened
  std::function<Status()> close_sandbox;  // before the first step
};
// Returns the exit status, which is 0 also if the device fails its test.
int test_device_main(const SelfTestChild& child);

struct SelfTestSettings {
  std::string executable;  // run as `<executable> test-device --device NAME --sandbox MODE …`
  std::string sandbox = "auto";
  std::string shader_dir = {};  // empty: the built-in shaders
  std::filesystem::path data_dir = {};
  bool tests_again = false;  // also where the outcome for this driver is known
  // Limit for a child, which itself ends a step that hangs. A software driver takes minutes for all
  // steps on a busy machine.
  std::chrono::milliseconds timeout_each = std::chrono::seconds(1800);
};

struct SelfTestReport {
  bool was_known = false;
  std::string failure;  // why there is no outcome; otherwise empty
  std::string warning;  // why the outcome could not be kept
  DeviceFaults faults;
};
// Tests the device, unless its outcome is known, and keeps the outcome in the data directory. A
// child that crashes or hangs in a step makes a fault of that step's part; another child then tests
// the other parts. After the first reset of the device the test is repeated.
SelfTestReport test_device(const SelfTestSettings& settings, const gpu::DeviceId& device);

// The outcome that a worker on this device would use, for people: "agrees with the CPU", the
// faults, or why there is none. The sources of the shaders are not compared.
std::string self_test_state(const std::filesystem::path& data_dir, const gpu::DeviceInfo& info);

}  // namespace voxeld
