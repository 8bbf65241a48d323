#include "server/worker/worker.h"

#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <exception>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "server/base/clock.h"
#include "server/base/disk/disk_reserve.h"
#include "server/base/log.h"
#include "server/process/machine.h"
#include "server/worker/device/calibration_key.h"
#include "server/worker/device/test_device.h"
#include "server/worker/gateway/device_slice.h"
#include "server/worker/gateway/task_client.h"
#include "server/worker/gateway/task_monitor.h"
#include "server/worker/run_task.h"
#include "server/worker/task/engine.h"

namespace voxeld {
namespace {

using nlohmann::json;

constexpr int kExitClean = 0;
constexpr int kExitNoGateway = 2;
constexpr int kExitDeviceUnavailable = 3;  // Supervisor::kExitDeviceUnavailable
constexpr int kExitContextLost = 4;        // Supervisor::kExitContextLost

// The sockets to the gateway, for the signal handler.
std::atomic<int> gateway_fd{-1}, slices_fd{-1};

// SIGTERM closes the connections. A waiting claim returns, the monitor cancels a running task, and
// the gateway queues the task again.
extern "C" void close_gateway(int) {
  ::shutdown(gateway_fd.load(), SHUT_RDWR);
  ::shutdown(slices_fd.load(), SHUT_RDWR);
}

void handle_signals(int fd, int fd_of_slices) {
  gateway_fd = fd;
  slices_fd = fd_of_slices;
  struct sigaction action {};
  action.sa_handler = close_gateway;
  action.sa_flags = SA_RESTART;
  ::sigaction(SIGTERM, &action, nullptr);
  ::signal(SIGINT, SIG_IGN);  // Ctrl-C goes to the daemon, which sends SIGTERM
  ::signal(SIGPIPE, SIG_IGN);
}

// memory_bytes: 0 if the driver does not report it.
json device_json(const gpu::DeviceInfo& info, int64_t memory_bytes) {
  return {{"vendor", info.vendor},
          {"renderer", info.renderer},
          {"version", info.version},
          {"glsl_version", info.glsl_version},
          {"is_software", info.is_software},
          {"pci_address", info.pci_address},
          {"memory_bytes", memory_bytes},
          {"has_int64", info.has_int64},
          {"ssbo_bytes_max", info.ssbo_bytes_max},
          {"texture_side_max", info.texture_side_max},
          {"texture3d_side_max", info.texture3d_side_max},
          {"framebuffer_side_max", info.framebuffer_side_max},
          {"dispatch_groups_max", info.dispatch_groups_max},
          {"loop_iterations_max", info.loop_iterations_max}};
}

WorkerHello make_hello(const gpu::DeviceId& device) {
  WorkerHello hello;
  hello.pid = ::getpid();
  hello.device = gpu::device_name(device);
  hello.device_json = "{}";
  return hello;
}

// Tells the gateway why there will be no worker; /readyz reports the reason.
int report_unavailable(TaskClient& client, const gpu::DeviceId& device, const Error& error) {
  log::error("cannot open the device", {{"error", error.message()}});
  if (client.hello(make_hello(device))) (void)client.report(TaskFailure{"", 0, error}).ok();
  return kExitDeviceUnavailable;
}

void log_outcome(const Task& task, const TaskOutcome& outcome, double ms) {
  const auto* failure = std::get_if<TaskFailure>(&outcome);
  const std::string_view what = failure != nullptr                                ? "task failed"
                                : std::holds_alternative<TaskPreemption>(outcome) ? "task preempted"
                                                                                  : "task done";
  log::info(what, {{"job", task.id},
                   {"kind", job_kind_name(task.kind)},
                   {"request", task.request_id},
                   {"trace", task.trace_id},
                   {"ms", ms},
                   {"error", failure == nullptr ? "" : failure->error.message()}});
}

// If the driver has lost the context, the job may succeed in a fresh process. A failure is not
// reported, so the gateway queues the job again when this process ends. A job that the CPU went on
// with has an outcome; the process then ends after the report. Returns the exit status.
std::optional<int> check_context(Engine& engine, const Task& task, const TaskOutcome& outcome) {
  const auto* failure = std::get_if<TaskFailure>(&outcome);
  const bool has_failed =
      failure != nullptr && (failure->error.code == ErrorCode::kInternal ||
                             failure->error.code == ErrorCode::kDeviceUnavailable);
  if (!has_failed && engine.device_failure.empty()) return std::nullopt;
  const Status context = engine.device.check("after a failed task");
  if (context) return std::nullopt;
  log::error("the context is lost", {{"job", task.id}, {"error", context.error().message()}});
  return kExitContextLost;
}

// The failure of the device that the gateway is told; empty: all of it works.
std::string device_failure(const Engine& engine) {
  constexpr size_t kTextBytesMax = 2000;  // a compiler's log may be longer than a message
  std::string failure = engine.device_failure;
  if (failure.empty() && engine.device_faults.any()) {
    failure = "self-test: " + engine.device_faults.text();
  }
  if (failure.size() > kTextBytesMax) failure.resize(kTextBytesMax);
  return failure;
}

// Tells the gateway, if that has changed, how the device did; /readyz and the metrics show it.
void report_device(const Engine& engine, TaskClient& client, std::string& reported) {
  std::string failure = device_failure(engine);
  if (failure == reported) return;
  reported = std::move(failure);
  if (!reported.empty()) log::error("the device failed", {{"error", reported}});
  (void)client.report(TaskFailure{"", 0, {ErrorCode::kDeviceUnavailable, reported, "", ""}}).ok();
}

// Runs one task and reports on it. reported_failure: the device's, as the gateway knows it. Returns
// an exit status if the process should end.
std::optional<int> handle_task(Engine& engine, TaskClient& client, SliceClient* slices,
                               const Task& task, const std::filesystem::path& scratch,
                               std::string& reported_failure) {
  const Stopwatch watch;
  engine.begin_task_of(task.tenant);
  TaskOutcome outcome;
  {
    TaskMonitor monitor(client, task, engine.device.memory);
    outcome = run_task(engine, task, scratch, monitor, slices);
    log_outcome(task, outcome, watch.ms());
    const auto lost = check_context(engine, task, outcome);
    if (lost && std::holds_alternative<TaskFailure>(outcome)) return lost;
    report_device(engine, client, reported_failure);
    if (monitor.dropped()) outcome = TaskDropped{};
    const bool is_reported = std::holds_alternative<TaskDropped>(outcome) || client.report(outcome);
    if (lost) return lost;
    if (!is_reported) return kExitClean;  // the gateway is gone
  }
  return std::nullopt;
}

}  // namespace

int serve_tasks(Engine& engine, TaskClient& client, SliceClient* slices,
                const std::filesystem::path& scratch) {
  std::string reported_failure = device_failure(engine);  // by hello
  if (!reported_failure.empty()) log::error("the device failed", {{"error", reported_failure}});
  while (true) {
    const auto task = client.claim();
    if (!task) {
      const bool gone = task.error().code == ErrorCode::kGone;
      if (!gone) log::error("cannot claim", {{"error", task.error().message()}});
      return gone ? kExitClean : kExitNoGateway;
    }
    const auto exit = handle_task(engine, client, slices, *task, scratch, reported_failure);
    if (exit) return *exit;
  }
}

namespace {

// Loads the calibration. Without a usable file, only the choice of pipelines lacks its numbers.
void use_calibration(const std::filesystem::path& data_dir, Engine& engine) {
  const gpu::DeviceInfo& info = engine.device.info;
  CalibrationLookup lookup = find_calibration(data_dir / kCalibrationFileName,
                                              gpu::device_name(info.device), calibration_key(info));
  if (lookup.found) {
    log::info("calibration", {{"date", lookup.calibration.date}});
  } else if (lookup.is_unreadable) {
    log::warn("the calibration cannot be read; voxeld doctor --calibrate makes a new one",
              {{"error", lookup.why_not}});
  } else {
    log::info("no calibration", {{"why", lookup.why_not}});
  }
  engine.voxelizer.set_calibration(std::move(lookup));
}

// Leaves what failed the self-test unused. Hardware that was not tested is not used either: the
// daemon tests it when it starts, so its driver has changed since. Software drivers are tested when
// they are calibrated; `auto` does not take them before.
void use_self_test(const std::filesystem::path& data_dir, Engine& engine) {
  const gpu::DeviceInfo& info = engine.device.info;
  if (info.device.kind == gpu::DeviceKind::kCpu) return;
  const SelfTestLookup lookup =
      find_self_test(data_dir, gpu::device_name(info.device), self_test_key(engine.device));
  if (lookup.found) {
    engine.set_device_faults(lookup.faults);
  } else if (!info.is_software) {
    engine.set_device_faults(
        all_faulty(lookup.why_not + "; the daemon tests the device when it starts"));
  }
}

Result<int> run_worker(const WorkerConfig& config) {
  VOXELD_ASSIGN(const auto client, TaskClient::connect(config.gateway));
  VOXELD_ASSIGN(const auto slices, SliceClient::connect(config.gateway));
  handle_signals(client->fd(), slices->fd());
  VOXELD_TRY(slices->hello({kTaskProtocolVersion, ::getpid(), gpu::device_name(config.device)}));
  offer_to_oom_killer();
  const int64_t memory = memory_limit_bytes();  // the sandbox hides the control group
  WorkerSandbox sandbox(config.sandbox);
  VOXELD_ASSIGN(const WorkerFolders folders, client->prepare());
  keep_disk_reserve(folders.disk_reserve_bytes);
  if (Status entered = sandbox.restrict_to(folders, config.data_dir, config.shader_dir); !entered) {
    return report_unavailable(*client, config.device, entered.error());
  }
  auto device = open_device(config.device, config.shader_dir);
  if (!device) {
    return report_unavailable(
        *client, config.device,
        sandbox.suspected(std::move(device).error(), gpu::device_name(config.device)));
  }
  Engine engine(*std::move(device));
  if (memory > 0) engine.voxelizer.set_host_bytes_max(memory / 4 * 3);
  engine.part_interval =
      std::chrono::milliseconds(static_cast<int64_t>(config.part_seconds * 1000.0));
  const gpu::DeviceInfo& info = engine.device.info;
  if (!config.data_dir.empty()) {
    use_calibration(config.data_dir, engine);
    use_self_test(config.data_dir, engine);
  }
  // Sandbox last: drivers have now loaded their libraries and started their threads.
  if (Status entered = sandbox.close(); !entered) {
    return report_unavailable(*client, config.device, entered.error());
  }
  WorkerHello hello = make_hello(config.device);
  hello.sandbox = sandbox.level();
  hello.device_failure = device_failure(engine);
  hello.renderer = info.renderer;
  hello.driver = info.version;
  hello.device_json = device_json(info, engine.device.memory().bytes_total)
                          .dump(-1, ' ', false, json::error_handler_t::replace);
  VOXELD_ASSIGN(const std::string scratch, client->hello(hello));
  return serve_tasks(engine, *client, slices.get(), scratch);
}

}  // namespace

int worker_main(const WorkerConfig& config) {
  try {
    const auto status = run_worker(config);
    if (status) return *status;
    log::error("worker ends", {{"error", status.error().message()}});
  } catch (const std::exception& failure) {
    log::error("worker ends", {{"error", failure.what()}});
  }
  return kExitNoGateway;
}

}  // namespace voxeld
