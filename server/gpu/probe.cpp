// Probing devices in child processes: a driver may crash or hang while it loads, and Mesa keeps its
// first choice of driver for the life of a process, so no two can be tried in one.
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>

#include "server/base/file.h"
#include "server/base/stopwatch.h"
#include "server/gpu/device.h"

extern char** environ;

namespace voxeld::gpu {
namespace {

using nlohmann::json;

// More devices than this in one machine are not probed.
constexpr int kEglDevicesMax = 16;
// Of one child's answer; drivers that write to stdout must not fill the memory.
constexpr size_t kAnswerBytesMax = size_t{1} << 20;

DeviceInfo info_from_json(const DeviceId& device, const json& object) {
  DeviceInfo info;
  info.device = device;
  info.vendor = object.value("vendor", "");
  info.renderer = object.value("renderer", "");
  info.version = object.value("version", "");
  info.glsl_version = object.value("glsl_version", "");
  info.backend = object.value("backend", "");
  info.is_robust = object.value("is_robust", false);
  info.is_software = object.value("is_software", false);
  info.has_int64 = object.value("has_int64", false);
  info.has_timer_queries = object.value("has_timer_queries", false);
  info.ssbo_bytes_max = object.value("ssbo_bytes_max", int64_t{0});
  info.ssbo_bindings_max = object.value("ssbo_bindings_max", 0);
  info.ubo_bytes_max = object.value("ubo_bytes_max", 0);
  info.texture_side_max = object.value("texture_side_max", 0);
  info.texture3d_side_max = object.value("texture3d_side_max", 0);
  info.framebuffer_side_max = object.value("framebuffer_side_max", 0);
  info.dispatch_groups_max = object.value("dispatch_groups_max", int64_t{0});
  info.loop_iterations_max = object.value("loop_iterations_max", int64_t{0});
  return info;
}

// What a child wrote to stdout and how it ended.
struct ChildAnswer {
  std::string text;
  std::string failure;  // empty: it exited by itself with status 0
};

// Starts `program arguments...` with stdout on a pipe and stderr away: drivers complain there, and
// what matters is in the answer. Returns the pid, or -1 with errno.
pid_t start_child(const std::vector<std::string>& command, int stdout_fd) {
  std::vector<char*> arguments;
  arguments.reserve(command.size() + 1);
  for (const std::string& one : command) arguments.push_back(const_cast<char*>(one.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, stdout_fd, STDOUT_FILENO);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t pid = -1;
  const int failed =
      ::posix_spawn(&pid, arguments[0], &actions, nullptr, arguments.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (failed == 0) return pid;
  errno = failed;
  return -1;
}

// Reads until the end of the pipe; false when the time is up.
bool read_answer(int fd, std::chrono::milliseconds timeout, std::string& text) {
  const Stopwatch clock;
  char buffer[4096];
  while (text.size() < kAnswerBytesMax) {
    const double left_ms = static_cast<double>(timeout.count()) - clock.ms();
    if (left_ms <= 0) return false;
    pollfd waiting{fd, POLLIN, 0};
    if (::poll(&waiting, 1, static_cast<int>(left_ms) + 1) <= 0) continue;
    const ssize_t bytes = ::read(fd, buffer, sizeof buffer);
    if (bytes == 0) return true;
    if (bytes > 0) text.append(buffer, static_cast<size_t>(bytes));
    if (bytes < 0 && errno != EINTR) return true;
  }
  return true;
}

ChildAnswer run_child(const std::vector<std::string>& command, std::chrono::milliseconds timeout) {
  ChildAnswer answer;
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) {
    answer.failure = std::string("pipe: ") + std::strerror(errno);
    return answer;
  }
  const UniqueFd read_end(ends[0]);
  UniqueFd write_end(ends[1]);
  const pid_t pid = start_child(command, write_end.get());
  write_end.reset();
  if (pid < 0) {
    answer.failure = "cannot run " + command[0] + ": " + std::strerror(errno);
    return answer;
  }
  const bool in_time = read_answer(read_end.get(), timeout, answer.text);
  if (!in_time) ::kill(pid, SIGKILL);
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (!in_time) {
    answer.failure = "the driver did not answer within " + std::to_string(timeout.count()) + " ms";
  } else if (WIFSIGNALED(status)) {
    answer.failure = std::string("the driver crashed: ") + ::strsignal(WTERMSIG(status));
  } else if (WEXITSTATUS(status) != 0) {
    answer.failure = "the probe ended with status " + std::to_string(WEXITSTATUS(status));
  }
  return answer;
}

// The last line that is a JSON object; drivers may have written others before it.
json parse_answer(const std::string& text) {
  const size_t start = text.rfind("\n{") == std::string::npos ? 0 : text.rfind("\n{") + 1;
  return json::parse(text.substr(start), nullptr, /*allow_exceptions=*/false);
}

struct ProbeOutcome {
  DeviceProbe probe;
  int egl_device_count = -1;  // that EGL enumerates; -1: the child did not say
};

ProbeOutcome probe_one(const std::string& self_executable, const DeviceId& device,
                       std::chrono::milliseconds timeout) {
  ProbeOutcome outcome;
  outcome.probe.device = device;
  const ChildAnswer answer =
      run_child({self_executable, "probe-device", "--device", device_name(device)}, timeout);
  const json object = parse_answer(answer.text);
  if (!object.is_object()) {
    outcome.probe.reason = device_name(device) + ": " +
                           (answer.failure.empty() ? "the probe gave no answer" : answer.failure);
    return outcome;
  }
  try {
    outcome.egl_device_count = object.value("egl_device_count", -1);
    outcome.probe.works = object.value("works", false) && answer.failure.empty();
    outcome.probe.reason = object.value("reason", "");
    outcome.probe.context_ms = object.value("context_ms", 0.0);
    if (outcome.probe.works) outcome.probe.info = info_from_json(device, object.at("info"));
  } catch (const json::exception& error) {
    outcome.probe.works = false;
    outcome.probe.reason = std::string("the probe's answer is not understood: ") + error.what();
  }
  if (!answer.failure.empty() && outcome.probe.reason.empty()) {
    outcome.probe.reason = device_name(device) + ": " + answer.failure;
  }
  return outcome;
}

}  // namespace

std::vector<DeviceProbe> probe_devices(const std::string& self_executable,
                                       std::chrono::milliseconds timeout_each) {
  std::vector<DeviceProbe> probes;
  // egl:0 is probed in any case, so that its reason tells why there is no hardware.
  int egl_device_count = kEglDevicesMax;
  for (int index = 0; index == 0 || index < egl_device_count; ++index) {
    ProbeOutcome outcome = probe_one(self_executable, {DeviceKind::kEgl, index}, timeout_each);
    if (outcome.egl_device_count >= 0) {
      egl_device_count = std::min(outcome.egl_device_count, kEglDevicesMax);
    }
    probes.push_back(std::move(outcome.probe));
    // A child that cannot even be started would not start for the next number either.
    if (outcome.egl_device_count < 0 && index > 0 && !probes.back().works) break;
  }
  for (const DeviceKind kind :
       {DeviceKind::kLlvmpipe, DeviceKind::kLavapipe, DeviceKind::kOsmesa}) {
    probes.push_back(probe_one(self_executable, {kind, 0}, timeout_each).probe);
  }
  DeviceProbe cpu;
  cpu.device = {DeviceKind::kCpu, 0};
  cpu.works = true;
  cpu.info = cpu_device_info();
  probes.push_back(std::move(cpu));
  return probes;
}

}  // namespace voxeld::gpu
