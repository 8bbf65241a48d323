#include "server/serve.h"

#include <prometheus/registry.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <optional>
#include <utility>

#include "server/address_file.h"
#include "server/api/api_server.h"
#include "server/base/clock.h"
#include "server/base/log.h"
#include "server/descriptors.h"
#include "server/device/auto_device.h"
#include "server/device/device.h"
#include "server/device/missing_driver.h"
#include "server/exit_status.h"
#include "server/jobs/auth/key_ring.h"
#include "server/jobs/auth/url_secret.h"
#include "server/jobs/service/job_service.h"
#include "server/process/machine.h"
#include "server/process/memory_reserve.h"
#include "server/shutdown_watch.h"
#include "server/store/data_dir.h"
#include "server/worker/device/test_device.h"

namespace voxeld {
namespace {

// How long the line that says "ready" waits for a worker; the daemon listens before that.
constexpr double kReadySecondsMax = 60.0;
constexpr double kSignalWaitSeconds = 3600.0;  // then it waits again
// --exit-when-idle is late by at most this.
constexpr double kIdleLookSeconds = 0.5;

// "auto" becomes the device that this machine runs best; the others are checked.
Result<std::vector<std::string>> resolve_devices(const ServeConfig& config,
                                                 const std::string& self_executable) {
  std::vector<std::string> devices;
  for (const std::string& name : config.devices) {
    if (name != "auto") {
      VOXELD_ASSIGN(const gpu::DeviceId device, gpu::parse_device(name));
      devices.push_back(gpu::device_name(device));
      continue;
    }
    const Stopwatch watch;
    const gpu::AutoChoice choice =
        gpu::probe_auto_device({.executable = self_executable,
                                .sandbox = config.sandbox,
                                .compares_sandbox = gpu::has_gpu_node()});
    log::info(
        "device chosen",
        {{"device", gpu::device_name(choice.device)}, {"why", choice.why}, {"ms", watch.ms()}});
    devices.push_back(gpu::device_name(choice.device));
  }
  return devices;
}

// Tests each GPU whose driver has not been tested, before workers use it. Software drivers are
// tested when they are calibrated. Workers find the outcome in the data directory.
Status test_devices(const ServeConfig& config, const std::vector<std::string>& devices,
                    const std::string& self_executable) {
  for (const std::string& name : devices) {
    VOXELD_ASSIGN(const gpu::DeviceId device, gpu::parse_device(name));
    if (device.kind != gpu::DeviceKind::kEgl) continue;
    const Stopwatch watch;
    const SelfTestReport report = test_device({.executable = self_executable,
                                               .sandbox = config.sandbox,
                                               .shader_dir = config.shader_dir,
                                               .data_dir = config.data_dir},
                                              device);
    if (!report.failure.empty()) {
      log::error("self-test", {{"device", name}, {"error", report.failure}});
    } else if (report.faults.any()) {
      log::error("self-test", {{"device", name},
                               {"faults", report.faults.text()},
                               {"was_known", report.was_known},
                               {"ms", watch.ms()}});
    } else {
      log::info("self-test",
                {{"device", name}, {"was_known", report.was_known}, {"ms", watch.ms()}});
    }
    if (!report.warning.empty()) {
      log::warn("the outcome of the self-test is not kept", {{"error", report.warning}});
    }
  }
  return {};
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ",") + name;
  return text;
}

// "127.0.0.1:0" and the port that was taken -> "http://127.0.0.1:43210"
std::string url_of(const std::string& listen, int port) {
  return "http://" + listen.substr(0, listen.rfind(':')) + ":" + std::to_string(port);
}

// Returns the signal that came meanwhile, or 0. Errors: device-unavailable when every device was
// tried and none works: who starts a daemon wants to hear that now. (Later the supervisor goes on
// trying.)
Result<int> wait_for_worker(JobService& jobs, ShutdownWatch& watch_of_end) {
  const Stopwatch watch;
  while (watch.ms() < kReadySecondsMax * 1000.0) {
    const std::vector<WorkerState> workers = jobs.workers();
    const auto is_connected = [](const WorkerState& worker) { return worker.connected; };
    const auto has_failed = [](const WorkerState& worker) { return !worker.last_error.empty(); };
    // Not jobs.ready(): on a full disk it refuses jobs, and clients can delete.
    if (std::any_of(workers.begin(), workers.end(), is_connected)) return 0;
    if (std::all_of(workers.begin(), workers.end(), has_failed)) {
      if (const Status ready = jobs.ready(); !ready) return ready.error();
    }
    if (const int signal = watch_of_end.wait(0.02); signal != 0) return signal;
  }
  if (const Status ready = jobs.ready(); !ready) {
    log::error("no worker yet; jobs wait", {{"reason", ready.error().message()}});
  }
  return 0;
}

// The rest is for the gateway, the system and its caches.
constexpr int64_t kMemoryShareMax = 4, kMemoryShare = 3;

// Worker processes, with those in reserve.
int processes_of_device(const ServeConfig& config) {
  const auto fixed = worker_isolation_of(config.worker_isolation);
  return config.workers_per_device +
         reserve_of(fixed.value_or(WorkerIsolation::kTenant), config.workers_per_device);
}

JobServiceConfig job_config(const ServeConfig& config, std::vector<std::string> devices,
                            const std::string& self_executable, const KeyRing& keys) {
  JobServiceConfig jobs;
  jobs.limits_of = [&keys](std::string_view tenant) { return keys.limits_of(tenant); };
  jobs.is_queue_shared = [&keys] { return keys.has_several_tenants(); };
  jobs.data_dir = config.data_dir;
  jobs.devices = std::move(devices);
  jobs.worker_executable = self_executable;
  jobs.worker_arguments = {"--log-level", std::string(log_level_name(config.log_level)),
                           "--data",      config.data_dir.string(),
                           "--sandbox",   config.sandbox};
  jobs.worker_arguments.insert(jobs.worker_arguments.end(),
                               {"--part-seconds", std::to_string(config.part_seconds)});
  if (!config.shader_dir.empty()) {
    jobs.worker_arguments.insert(jobs.worker_arguments.end(), {"--shader-dir", config.shader_dir});
  }
  jobs.queued_jobs_max = config.queued_jobs_max;
  jobs.workers_per_device = config.workers_per_device;
  jobs.is_fair = config.is_fair;
  jobs.memory_bytes_max = config.memory_bytes_max;
  if (jobs.memory_bytes_max == 0) {
    jobs.memory_bytes_max = memory_limit_bytes() / kMemoryShareMax * kMemoryShare;
  }
  jobs.weight_of = [&keys](const std::string& tenant) { return keys.weight_of(tenant); };
  jobs.storage = {config.store_bytes_max,  config.disk_reserve_bytes, config.keep_results_days,
                  config.keep_assets_days, config.keep_jobs_days,     config.keep_orphans_days};
  jobs.has_keys = [&keys] { return keys.needs_keys(); };
  jobs.forgets_keys = config.forgets_keys;
  jobs.store_match = config.adopts_store ? StoreMatch::kAdopt : StoreMatch::kRequired;
  jobs.isolation = [&keys, fixed = worker_isolation_of(config.worker_isolation)] {
    if (fixed) return *fixed;
    return keys.has_several_tenants() ? WorkerIsolation::kTenant : WorkerIsolation::kNone;
  };
  jobs.limits.job_seconds_max = config.job_seconds_max;
  jobs.limits.worker_memory_bytes_max = config.worker_memory_bytes_max > 0
                                            ? config.worker_memory_bytes_max
                                            : memory_limit_bytes() / 4 * 3;
  jobs.limits.scratch_bytes_max = config.worker_scratch_bytes_max;
  // Before the machine is out of memory, for then the kernel chooses who ends.
  jobs.limits.all_workers_memory_bytes_max = memory_limit_bytes() / 8 * 7;
  return jobs;
}

// "none", or where the admin port listens.
std::string admin_url(const ServeConfig& config, const api::ApiServer& server) {
  return server.admin_port() == 0 ? "none" : url_of(config.admin_listen, server.admin_port());
}

bool is_idle(api::ApiServer& server, JobService& jobs) {
  if (server.is_busy()) return false;
  const auto queue = jobs.queue(Caller::daemon());
  return queue && queue->queued + queue->running == 0;
}

// Removes the address file, unless a request came at that moment: a client reads the file, makes a
// request, and then looks whether the file is still there. Either it sees that it is not, or its
// request is seen here.
bool is_left_alone(const ServeConfig& config, api::ApiServer& server, JobService& jobs,
                   std::optional<AddressFile>& address) {
  if (!address) return true;
  const uint64_t requests = server.admitted_requests();
  address.reset();
  if (server.admitted_requests() == requests && is_idle(server, jobs)) return true;
  auto again = AddressFile::write(config.address_file, url_of(config.listen, server.port()));
  if (!again) {
    log::error("ends although a request came", {{"error", again.error().message()}});
    return true;
  }
  address.emplace(*std::move(again));
  return false;
}

// Returns the signal to end; after --exit-when-idle that is one of its own.
int wait_for_end(const ServeConfig& config, api::ApiServer& server, JobService& jobs,
                 std::optional<AddressFile>& address, ShutdownWatch& shutdown) {
  const double idle_seconds_max = config.exit_when_idle_seconds;
  const double slice =
      idle_seconds_max > 0 ? std::min(kIdleLookSeconds, idle_seconds_max) : kSignalWaitSeconds;
  Stopwatch idle;
  uint64_t requests = 0;
  while (true) {
    if (const int signal = shutdown.wait(slice); signal != 0) return signal;
    if (idle_seconds_max == 0) continue;
    if (const uint64_t now = server.admitted_requests();
        now != requests || !is_idle(server, jobs)) {
      requests = now;
      idle = Stopwatch();
    } else if (idle.ms() >= idle_seconds_max * 1000.0) {
      if (!is_left_alone(config, server, jobs, address)) continue;
      log::info("idle", {{"seconds", idle_seconds_max}});
      ::kill(::getpid(), SIGTERM);  // ends as by a signal from outside, watched likewise
      return shutdown.wait(kSignalWaitSeconds);
    }
  }
}

// Ends what serves, in the order in which it depends on each other. True: all of it has come to its
// end, and can be destroyed.
bool end_serving(api::ApiServer& server, JobService& jobs, double drain_seconds,
                 ShutdownWatch& shutdown) {
  shutdown.enter("drain");
  jobs.drain();
  const std::vector<http::RunningRequest> left = server.stop(drain_seconds);
  for (const http::RunningRequest& request : left) {
    log::error("a request did not end",
               {{"request", request.what}, {"peer", request.peer}, {"seconds", request.seconds}});
  }
  shutdown.enter("workers and jobs");
  jobs.stop();
  shutdown.enter("database");
  return left.empty();
}

Status serve(const ServeConfig& config, const std::string& self_executable) {
  VOXELD_TRY(check_data_dir(config.data_dir));  // before anything in it is believed
  VOXELD_ASSIGN(const auto keys, KeyRing::open(config.data_dir));
  const Guard guard = keys->needs_keys() ? Guard::kKeys : Guard::kNoKeys;
  VOXELD_TRY(check_listen_address("--listen", config.listen, config.allow_remote, guard));
  const bool has_admin = config.admin_listen != "none";
  if (has_admin) {
    VOXELD_TRY(check_listen_address("--admin-listen", config.admin_listen,
                                    config.admin_allow_remote, Guard::kNone));
  }
  VOXELD_ASSIGN(const auto devices, resolve_devices(config, self_executable));
  VOXELD_TRY(test_devices(config, devices, self_executable));
  ::signal(SIGPIPE, SIG_IGN);
  // Before any other thread.
  ShutdownWatch shutdown(config.drain_seconds);
  VOXELD_ASSIGN(
      const DescriptorPlan descriptors,
      share_out_descriptors({0, config.connections_max, config.connections_per_address,
                             kAdminConnectionsMax, config.request_threads},
                            static_cast<int>(devices.size()) * processes_of_device(config)));
  auto metrics = std::make_shared<prometheus::Registry>();
  HeldFiles held_files;
  JobServiceConfig jobs_config = job_config(config, devices, self_executable, *keys);
  jobs_config.held_bytes = [&held_files](std::string_view tenant) {
    return held_files.bytes(tenant);
  };
  VOXELD_ASSIGN(const auto jobs, start_job_service(jobs_config, metrics));
  // By now the data directory is this process's alone.
  VOXELD_ASSIGN(const auto secrets, UrlSecrets::open(config.data_dir));
  api::ApiServerConfig http_config;
  http_config.listen = config.listen;
  http_config.admin_listen = has_admin ? config.admin_listen : "";
  http_config.upload_bytes_max = config.upload_bytes_max;
  http_config.request_threads = descriptors.request_threads;
  http_config.connections_max = descriptors.connections;
  http_config.connections_per_address = descriptors.connections_per_address;
  http_config.admin_connections_max = descriptors.admin_connections;
  http_config.trusted_proxies = config.trusted_proxies;
  http_config.held_files = &held_files;
  http_config.web_dir = config.web_dir;
  http_config.origins = {config.public_hosts, config.cors_origins};
  VOXELD_ASSIGN(const auto server,
                api::start_api_server(http_config, *jobs, *keys, *secrets, metrics));
  log::info("listening", {{"url", url_of(config.listen, server->port())},
                          {"admin", admin_url(config, *server)},
                          {"data", config.data_dir.string()}});
  if (guard == Guard::kNoKeys) {
    log::warn("there are no API keys: whoever reaches the daemon can use all of it",
              {{"hint", "voxeld keys add"}});
  }
  std::optional<AddressFile> address;
  if (!config.address_file.empty()) {
    VOXELD_ASSIGN(AddressFile file,
                  AddressFile::write(config.address_file, url_of(config.listen, server->port())));
    address.emplace(std::move(file));
  }
  VOXELD_ASSIGN(int signal, wait_for_worker(*jobs, shutdown));
  if (signal == 0) {
    std::printf("ready %s admin=%s device=%s\n", url_of(config.listen, server->port()).c_str(),
                admin_url(config, *server).c_str(), joined(devices).c_str());
    std::fflush(stdout);
    signal = wait_for_end(config, *server, *jobs, address, shutdown);
  }
  address.reset();
  log::info("stopping", {{"signal", signal}});
  if (!end_serving(*server, *jobs, config.drain_seconds, shutdown)) {
    // Their threads use what would be destroyed now.
    log::info("stopped, with requests that did not end");
    ::_exit(0);
  }
  return {};
}

}  // namespace

int serve_main(const ServeConfig& config, const std::string& self_executable) {
  log::configure(config.log_level, "gateway");
  hold_memory_reserve();
  const Status status = serve(config, self_executable);
  if (status) {
    log::info("stopped");
    return 0;
  }
  std::fprintf(stderr, "voxeld: %s\n", status.error().message().c_str());
  return kExitFailure;
}

}  // namespace voxeld
