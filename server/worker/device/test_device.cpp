#include "server/worker/device/test_device.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>

#include "server/base/algorithm_version.h"
#include "server/base/thread_annotations.h"
#include "server/process/child_process.h"
#include "server/worker/device/open_device.h"
#include "server/worker/device/self_test.h"

namespace voxeld {
namespace {

using nlohmann::json;

// The slowest step takes 11 s on a software driver that compiles on two busy cores; a machine that
// others use, too, or a sanitizer, takes many times as long.
constexpr std::chrono::seconds kStepTimeout{300};

// Prints the object on a line of its own, because drivers may have written before it.
void print_json_line(const json& object) {
  std::printf("\n%s\n", object.dump(-1, ' ', false, json::error_handler_t::replace).c_str());
  std::fflush(stdout);
}

// Ends the process when a step lasts too long: the daemon's start waits for the child, and a driver
// that hangs must not hold it up.
class StepWatch {
 public:
  StepWatch() : thread_([this] { watch(); }) {}
  ~StepWatch() {
    {
      const MutexLock lock(mutex_);
      is_over_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }
  StepWatch(const StepWatch&) = delete;
  StepWatch& operator=(const StepWatch&) = delete;

  void begin_step() {
    {
      const MutexLock lock(mutex_);
      ++steps_;
    }
    changed_.notify_all();
  }

 private:
  void watch() {
    MutexLock lock(mutex_);
    while (!is_over_) {
      const size_t step = steps_;
      const auto end = std::chrono::steady_clock::now() + kStepTimeout;
      bool is_late = false;
      while (!is_over_ && steps_ == step && !is_late) {
        is_late = changed_.wait_until(lock, end) == std::cv_status::timeout;
      }
      if (is_over_ || steps_ != step) continue;
      print_json_line({{"hung", true}});
      ::_exit(0);
    }
  }

  Mutex mutex_;
  CondVar changed_;
  size_t steps_ GUARDED_BY(mutex_) = 0;
  bool is_over_ GUARDED_BY(mutex_) = false;
  std::thread thread_;  // last: it uses the others
};

Status test_opened(const SelfTestChild& child) {
  VOXELD_TRY(child.enter_sandbox());
  VOXELD_ASSIGN(OpenedDevice opened, open_device(child.device, child.shader_dir));
  VOXELD_TRY(child.close_sandbox());
  const SelfTestKey key = self_test_key(opened);
  print_json_line({{"key", {key.renderer, key.driver, key.shaders}}});
  if (!child.data_dir.empty()) {
    const std::string name = gpu::device_name(child.device);
    if (find_self_test(child.data_dir, name, key).found) {
      print_json_line({{"known", true}});
      return {};
    }
  }
  DeviceFaults skipped;
  for (const std::string& name : child.skipped) {
    if (const auto part = device_part_from(name)) skipped.add(*part, "skipped");
  }
  Voxelizer voxelizer(std::move(opened.pipeline));
  StepWatch watch;
  const DeviceFaults found = self_test(
      {voxelizer, opened.gl_renderer.get(), *opened.cpu_renderer, opened.info.is_software}, skipped,
      [&watch](DevicePart part, std::string_view step) {
        watch.begin_step();
        print_json_line({{"part", device_part_name(part)}, {"step", step}});
      });
  json faults = json::object();
  for (size_t i = 0; i < kDevicePartCount; ++i) {
    const auto part = static_cast<DevicePart>(i);
    if (!found.has(part) || skipped.has(part)) continue;
    faults[std::string(device_part_name(part))] = found.why(part);
  }
  if (!opened.check("after the self-test")) print_json_line({{"lost", true}});
  print_json_line({{"faults", faults}});
  return {};
}

// The messages that a child printed before it ended.
struct ChildStory {
  std::optional<SelfTestKey> key;
  bool is_known = false;
  bool is_done = false;
  bool is_hung = false;
  bool is_lost = false;  // the device was reset
  std::string reason;
  std::optional<DevicePart> part;  // of the last step
  std::string step;
};

std::string text_of(const json& object, const char* name) {
  const auto found = object.find(name);
  return found != object.end() && found->is_string() ? found->get<std::string>() : "";
}

void read_line(std::string_view line, ChildStory& story, DeviceFaults& faults) {
  const json object = json::parse(line, nullptr, /*allow_exceptions=*/false);
  if (!object.is_object()) return;
  if (const auto key = object.find("key"); key != object.end() && key->is_array() &&
                                           key->size() == 3 && (*key)[0].is_string() &&
                                           (*key)[1].is_string() && (*key)[2].is_string()) {
    story.key = {(*key)[0].get<std::string>(), (*key)[1].get<std::string>(),
                 (*key)[2].get<std::string>(), kAlgorithmVersion};
  }
  if (object.contains("hung")) story.is_hung = true;
  if (object.contains("lost")) story.is_lost = true;
  if (object.contains("known")) story.is_known = true;
  if (object.contains("reason")) story.reason = text_of(object, "reason");
  if (object.contains("step")) {
    story.part = device_part_from(text_of(object, "part"));
    story.step = text_of(object, "step");
  }
  if (const auto list = object.find("faults"); list != object.end() && list->is_object()) {
    story.is_done = true;
    for (const auto& [name, why] : list->items()) {
      const auto part = device_part_from(name);
      if (part && why.is_string() && !why.get<std::string>().empty()) {
        faults.add(*part, why.get<std::string>());
      }
    }
  }
}

ChildStory read_story(std::string_view text, DeviceFaults& faults) {
  ChildStory story;
  while (!text.empty()) {
    const size_t end = text.find('\n');
    if (text.starts_with('{')) read_line(text.substr(0, end), story, faults);
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
  }
  return story;
}

// Whether the device, when it was tested, lacked memory that other processes of the machine had.
bool lacked_memory(const std::filesystem::path& data_dir, const std::string& device) {
  const auto outcomes = read_self_tests(data_dir);
  return outcomes && std::ranges::any_of(*outcomes, [&](const SelfTestOutcome& outcome) {
           // As gpu::Context::check() tells it.
           return outcome.device == device &&
                  outcome.faults.text().find("out of device memory") != std::string::npos;
         });
}

std::vector<std::string> child_command(const SelfTestSettings& settings, const std::string& device,
                                       const DeviceFaults& faults) {
  std::vector<std::string> command = {settings.executable, "test-device",   "--device", device,
                                      "--sandbox",         settings.sandbox};
  if (!settings.shader_dir.empty()) {
    command.insert(command.end(), {"--shader-dir", settings.shader_dir});
  }
  if (!settings.tests_again && !faults.any() && !lacked_memory(settings.data_dir, device)) {
    command.insert(command.end(), {"--data", settings.data_dir.string()});
  }
  for (size_t i = 0; i < kDevicePartCount; ++i) {
    const auto part = static_cast<DevicePart>(i);
    if (faults.has(part))
      command.insert(command.end(), {"--skip", std::string(device_part_name(part))});
  }
  return command;
}

}  // namespace

SelfTestKey self_test_key(const OpenedDevice& device) {
  return {device.info.renderer, device.info.version, device.shaders, kAlgorithmVersion};
}

int test_device_main(const SelfTestChild& child) {
  const Status tested = test_opened(child);
  if (!tested) print_json_line({{"reason", tested.error().message()}});
  return 0;
}

SelfTestReport test_device(const SelfTestSettings& settings, const gpu::DeviceId& device) {
  const std::string name = gpu::device_name(device);
  SelfTestReport report;
  bool was_lost = false;
  for (size_t child = 0; child <= kDevicePartCount + 1; ++child) {
    const ChildReply reply =
        run_child(child_command(settings, name, report.faults), settings.timeout_each);
    DeviceFaults faults = report.faults;
    const ChildStory story = read_story(reply.text, faults);
    if (story.is_lost && !was_lost) {
      was_lost = true;  // another process may have caused the reset, but hardly twice
      continue;
    }
    report.faults = std::move(faults);
    if (story.is_known && story.key) {
      report.was_known = true;
      report.faults = find_self_test(settings.data_dir, name, *story.key).faults;
      return report;
    }
    if (story.is_done && story.key) {
      const Status kept = keep_self_test(settings.data_dir, {name, *story.key, report.faults});
      if (!kept) report.warning = kept.error().message();
      return report;
    }
    if (!story.part || report.faults.has(*story.part)) {
      report.failure = !story.reason.empty()    ? story.reason
                       : !reply.failure.empty() ? reply.failure
                                                : "the self-test gave no reply";
      return report;
    }
    const std::string how = story.is_hung
                                ? "no end after " + std::to_string(kStepTimeout.count()) + " s"
                            : !reply.failure.empty() ? reply.failure
                                                     : "the driver ended the process";
    report.faults.add(*story.part, story.step + ": " + how);
  }
  report.failure = "every part of the device ends its process";
  return report;
}

std::string self_test_state(const std::filesystem::path& data_dir, const gpu::DeviceInfo& info) {
  SelfTestKey key{info.renderer, info.version, "", kAlgorithmVersion};
  const std::string name = gpu::device_name(info.device);
  if (const auto outcomes = read_self_tests(data_dir)) {
    for (const SelfTestOutcome& one : *outcomes) {
      if (one.device == name) key.shaders = one.key.shaders;
    }
  }
  const SelfTestLookup lookup = find_self_test(data_dir, name, key);
  if (!lookup.found) return lookup.why_not;
  return lookup.faults.any() ? "differs from the CPU: " + lookup.faults.text()
                             : "agrees with the CPU";
}

}  // namespace voxeld
