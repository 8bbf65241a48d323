#include "server/config.h"

#include <arpa/inet.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cstdlib>
#include <map>
#include <optional>
#include <string_view>
#include <utility>

#include "proto/text/number_text.h"
#include "server/http/message/authority.h"
#include "server/jobs/auth/api_key.h"

namespace voxeld {
namespace {

const std::map<std::string, log::Level>& log_levels() {
  static const std::map<std::string, log::Level> levels = {{"debug", log::Level::kDebug},
                                                           {"info", log::Level::kInfo},
                                                           {"warn", log::Level::kWarn},
                                                           {"error", log::Level::kError}};
  return levels;
}

std::filesystem::path default_data_dir() {
  if (const char* state = std::getenv("XDG_STATE_HOME"); state != nullptr && *state == '/') {
    return std::filesystem::path(state) / "voxeld";
  }
  const char* home = std::getenv("HOME");
  return std::filesystem::path(home != nullptr && *home == '/' ? home : "/tmp") /
         ".local/state/voxeld";
}

// More would wait for one another, and each has its memory.
constexpr int kWorkersPerDeviceMax = 64;

// A thousand years. Before the year 1000, the names of days no longer sort by time, and days that
// are younger would be removed.
constexpr int64_t kKeepDaysMax = 365'000;
// The same in seconds.
constexpr int64_t kJobSecondsMax = kKeepDaysMax * 86'400;

// A number of seconds or days in [0, max]. CLI::Range takes NaN.
CLI::Validator up_to(int64_t max) {
  const auto check = [max](const std::string& text) -> std::string {
    if (parse_number<double>(text, 0.0, static_cast<double>(max))) return "";
    return "expected a number from " + range_text(0, max) + ", got " + text;
  };
  return {check, "FLOAT in [0 - " + std::to_string(max) + "]"};
}

// The error of an IPv6 address; empty for a valid one.
std::string is_ipv6(const std::string& text) {
  in6_addr address{};
  return ::inet_pton(AF_INET6, text.c_str(), &address) == 1 ? "" : "not an IPv6 address: " + text;
}

// A name or address that clients put into Host.
std::string check_public_host(const std::string& text) {
  const auto authority = parse_authority(text);
  const bool is_host = authority && !authority->host.empty() && authority->port == 0 &&
                       text.size() == authority->host.size();
  return is_host ? "" : "expected a host name without a port, got " + text;
}

std::string check_cors_origin(const std::string& text) {
  if (parse_origin(text)) return "";
  return "expected an origin such as https://app.example.org or http://localhost:3000, got " + text;
}

void add_log_level(CLI::App& command, log::Level& level) {
  command.add_option("--log-level", level, "Lowest level that is logged: debug, info, warn, error")
      ->transform(CLI::CheckedTransformer(log_levels(), CLI::ignore_case))
      ->envname("VOXELD_LOG_LEVEL");
}

void add_scheduling(CLI::App& serve, ServeConfig& config) {
  static const std::map<std::string, bool> schedulers = {{"fair", true}, {"fifo", false}};
  serve
      .add_option("--workers-per-device", config.workers_per_device,
                  "Worker processes of a device: one works on it while others read and write")
      ->check(CLI::Range(1, kWorkersPerDeviceMax))
      ->envname("VOXELD_WORKERS_PER_DEVICE")
      ->capture_default_str();
  serve
      .add_option("--scheduler", config.is_fair,
                  "fair: tenants share devices by their weights; fifo: whole jobs as they arrived")
      ->transform(CLI::CheckedTransformer(schedulers))
      ->envname("VOXELD_SCHEDULER")
      ->default_str("fair");
  serve
      .add_option("--memory-max", config.memory_bytes_max,
                  "What jobs may need of the machine's memory at a time, as they are estimated, "
                  "with an optional unit; default: three quarters of it")
      ->transform(CLI::AsSizeValue(false))
      ->check(CLI::PositiveNumber)
      ->envname("VOXELD_MEMORY_MAX");
}

void add_storage(CLI::App& serve, ServeConfig& config) {
  serve
      .add_option("--store-bytes-max", config.store_bytes_max,
                  "Over it, results go that were not used for the longest time (50G; 0: never)")
      ->transform(CLI::AsSizeValue(false))
      ->check(CLI::NonNegativeNumber)
      ->envname("VOXELD_STORE_BYTES_MAX")
      ->capture_default_str();
  serve
      .add_option(
          "--disk-reserve", config.disk_reserve_bytes,
          "Uploads and results are refused when less is free (1G, at most a 20th of the disk)")
      ->transform(CLI::AsSizeValue(false))
      ->check(CLI::NonNegativeNumber)
      ->envname("VOXELD_DISK_RESERVE")
      ->capture_default_str();
  const auto add_days = [&serve](const char* flag, double& days, const char* text,
                                 const char* variable) {
    serve.add_option(flag, days, text)
        ->check(up_to(kKeepDaysMax))
        ->envname(variable)
        ->capture_default_str();
  };
  add_days("--keep-results-days", config.keep_results_days,
           "Results, grids and frames go so long after they were used last (0: never)",
           "VOXELD_KEEP_RESULTS_DAYS");
  add_days("--keep-assets-days", config.keep_assets_days,
           "Assets go so long after they were used last (0: never)", "VOXELD_KEEP_ASSETS_DAYS");
  add_days("--keep-jobs-days", config.keep_jobs_days,
           "Jobs are forgotten so long after they ended (0: never)", "VOXELD_KEEP_JOBS_DAYS");
  add_days("--keep-orphans-days", config.keep_orphans_days,
           "Files that the database does not know stay so long in DIR/quarantine (0: for ever)",
           "VOXELD_KEEP_ORPHANS_DAYS");
  // No variable: it is for one start.
  serve.add_flag("--adopt", config.adopts_store,
                 "Go on with a database that is not the one of the files, or is older: files that "
                 "it does not know go to DIR/quarantine");
  serve.add_flag("--forget-keys", config.forgets_keys,
                 "Start open to everybody though DIR/keys, which was there, is gone");
}

CLI::Option* add_sandbox(CLI::App& command, std::string& mode) {
  return command
      .add_option("--sandbox", mode,
                  "What workers give up before they read inputs: auto (what the kernel can take), "
                  "require (all, or they do not start) or off")
      ->check(CLI::IsMember({"auto", "require", "off"}))
      ->capture_default_str();
}

void add_worker_limits(CLI::App& serve, ServeConfig& config) {
  add_sandbox(serve, config.sandbox)->envname("VOXELD_SANDBOX");
  serve
      .add_option("--worker-isolation", config.worker_isolation,
                  "tenant: a worker process that has read a file of one tenant gets no task of "
                  "another; task: each gets one task; none; auto: tenant where several tenants "
                  "have keys, else none")
      ->check(CLI::IsMember({"auto", "tenant", "task", "none"}))
      ->envname("VOXELD_WORKER_ISOLATION")
      ->capture_default_str();
  serve
      .add_option("--worker-memory-max", config.worker_memory_bytes_max,
                  "Memory that one worker process may take (8G); 0: 3/4 of the machine's, or of "
                  "the control group's")
      ->transform(CLI::AsSizeValue(false))
      ->check(CLI::NonNegativeNumber)
      ->envname("VOXELD_WORKER_MEMORY_MAX")
      ->capture_default_str();
  serve
      .add_option("--worker-scratch-max", config.worker_scratch_bytes_max,
                  "Bytes that one worker process may write for its job (8G); 0: 1/4 of the disk")
      ->transform(CLI::AsSizeValue(false))
      ->check(CLI::NonNegativeNumber)
      ->envname("VOXELD_WORKER_SCRATCH_MAX")
      ->capture_default_str();
  serve
      .add_option("--job-seconds-max", config.job_seconds_max,
                  "How long one attempt at a job may run; 0: for ever")
      ->check(up_to(kJobSecondsMax))
      ->envname("VOXELD_JOB_SECONDS_MAX")
      ->capture_default_str();
}

// Flags of a daemon that a program starts for itself, as voxel does.
void add_private_use(CLI::App& serve, ServeConfig& config) {
  serve
      .add_option("--address-file", config.address_file,
                  "Write URL and pid as JSON to this file while serving, and hold a lock on it")
      ->envname("VOXELD_ADDRESS_FILE");
  serve
      .add_option("--exit-when-idle", config.exit_when_idle_seconds,
                  "End after so many seconds without a request and a job; 0: never")
      ->check(up_to(86'400))
      ->envname("VOXELD_EXIT_WHEN_IDLE")
      ->capture_default_str();
}

CLI::App* add_serve(CLI::App& app, ServeConfig& config) {
  CLI::App* serve = app.add_subcommand(
      "serve", "Serve HTTP and run jobs on worker processes of each device (the default)");
  serve->add_option("--listen", config.listen, "HOST:PORT of the API; port 0 takes a free one")
      ->envname("VOXELD_LISTEN")
      ->capture_default_str();
  serve
      ->add_option("--admin-listen", config.admin_listen,
                   "HOST:PORT of /livez, /readyz and /metrics, or none")
      ->envname("VOXELD_ADMIN_LISTEN")
      ->capture_default_str();
  serve
      ->add_flag("--allow-remote", config.allow_remote,
                 "Listen on other addresses than loopback, also without API keys")
      ->envname("VOXELD_ALLOW_REMOTE");
  serve
      ->add_flag("--admin-allow-remote", config.admin_allow_remote,
                 "Let --admin-listen be another address than loopback: metrics need no API key")
      ->envname("VOXELD_ADMIN_ALLOW_REMOTE");
  serve->add_option("--data", config.data_dir, "Directory of the database and of all files")
      ->envname("VOXELD_DATA")
      ->capture_default_str();
  serve
      ->add_option(
          "--device", config.devices,
          "auto, egl:N, pci:ADDRESS, llvmpipe, lavapipe, osmesa or cpu (no OpenGL), or several")
      ->delimiter(',')
      ->envname("VOXELD_DEVICE")
      ->capture_default_str();
  serve
      ->add_option("--upload-bytes-max", config.upload_bytes_max,
                   "Largest upload, with an optional unit (500M, 4G)")
      ->transform(CLI::AsSizeValue(false))
      ->check(CLI::PositiveNumber)
      ->envname("VOXELD_UPLOAD_BYTES_MAX")
      ->capture_default_str();
  serve->add_option("--queued-jobs-max", config.queued_jobs_max, "Jobs that may wait")
      ->check(CLI::PositiveNumber)
      ->envname("VOXELD_QUEUED_JOBS_MAX")
      ->capture_default_str();
  serve
      ->add_option("--request-threads", config.request_threads,
                   "Requests that are handled at a time")
      ->check(CLI::Range(1, 4096))
      ->envname("VOXELD_REQUEST_THREADS")
      ->capture_default_str();
  add_scheduling(*serve, config);
  add_private_use(*serve, config);
  serve->add_option("--connections-max", config.connections_max, "Open connections in all")
      ->check(CLI::Range(1, 1'000'000))
      ->envname("VOXELD_CONNECTIONS_MAX")
      ->capture_default_str();
  serve
      ->add_option("--connections-per-address", config.connections_per_address,
                   "Open connections of one address, but loopback and trusted proxies; 0: any")
      ->check(CLI::Range(0, 1'000'000))
      ->envname("VOXELD_CONNECTIONS_PER_ADDRESS")
      ->capture_default_str();
  serve
      ->add_option("--trusted-proxy", config.trusted_proxies,
                   "Address of a proxy whose X-Forwarded-For is believed; several with commas")
      ->delimiter(',')
      ->check(CLI::ValidIPV4 | CLI::Validator(is_ipv6, "IPV6"))
      ->envname("VOXELD_TRUSTED_PROXY");
  serve
      ->add_option("--public-host", config.public_hosts,
                   "Host name that clients use, beside loopback, while no API key is needed, and "
                   "always for the admin port; several with commas")
      ->delimiter(',')
      ->check(CLI::Validator(check_public_host, "HOST"))
      ->envname("VOXELD_PUBLIC_HOST");
  serve
      ->add_option("--cors-origin", config.cors_origins,
                   "Origin whose web pages may call the API; several with commas")
      ->delimiter(',')
      ->check(CLI::Validator(check_cors_origin, "ORIGIN"))
      ->envname("VOXELD_CORS_ORIGIN");
  serve
      ->add_option("--drain-seconds", config.drain_seconds,
                   "How long running requests may continue after SIGTERM, while new work gets 503")
      ->check(up_to(86'400))
      ->envname("VOXELD_DRAIN_SECONDS")
      ->capture_default_str();
  serve
      ->add_option(
          "--part-seconds", config.part_seconds,
          "How often the finished tiles of a long job are stored, to continue from them after "
          "a restart")
      ->check(up_to(3'600))
      ->envname("VOXELD_PART_SECONDS")
      ->capture_default_str();
  serve
      ->add_option("--shader-dir", config.shader_dir,
                   "Read shaders from here instead of the ones built in")
      ->check(CLI::ExistingDirectory)
      ->envname("VOXELD_SHADER_DIR");
  serve
      ->add_option("--web-dir", config.web_dir,
                   "Read files of the web page from here instead of the ones built in")
      ->check(CLI::ExistingDirectory)
      ->envname("VOXELD_WEB_DIR");
  add_storage(*serve, config);
  add_worker_limits(*serve, config);
  add_log_level(*serve, config.log_level);
  return serve;
}

CLI::App* add_worker(CLI::App& app, WorkerCommand& command) {
  CLI::App* worker =
      app.add_subcommand("worker", "Run tasks of a gateway on one device (serve starts these)");
  worker->add_option("--gateway", command.gateway, "unix:/path/to/tasks.sock")->required();
  worker
      ->add_option("--device", command.device,
                   "egl:N, pci:ADDRESS, llvmpipe, lavapipe, osmesa or cpu")
      ->required();
  worker->add_option("--shader-dir", command.shader_dir, "As of serve");
  worker->add_option("--data", command.data_dir, "Directory of calibration.json");
  worker->add_option("--part-seconds", command.part_seconds, "As of serve")->check(up_to(3'600));
  add_sandbox(*worker, command.sandbox);
  add_log_level(*worker, command.log_level);
  return worker;
}

CLI::App* add_test_device(CLI::App& app, TestDeviceCommand& command) {
  CLI::App* test = app.add_subcommand(
      "test-device", "Compare one device's grids and images with the CPU's and print JSON");
  test->add_option("--device", command.device)->required();
  test->add_option("--shader-dir", command.shader_dir, "As of serve");
  test->add_option(
      "--data", command.data_dir,
      "Directory of self_test.json; a device that it has an outcome for is not tested");
  test->add_option("--skip", command.skipped, "Parts of the device that are not tested");
  add_sandbox(*test, command.sandbox);
  return test;
}

CLI::App* add_doctor(CLI::App& app, DoctorCommand& command) {
  CLI::App* doctor =
      app.add_subcommand("doctor", "Tell which devices work here, and what auto chooses");
  doctor->add_flag("--json", command.json, "One JSON object instead of a table");
  CLI::Option* calibrate = doctor->add_flag(
      "--calibrate", command.calibrate,
      "Measure the pipelines of each device and store what pipeline=auto decides by");
  doctor
      ->add_flag("--store", command.store,
                 "Compare every file in the data directory with its name, and the database with "
                 "the files")
      ->excludes(calibrate);
  CLI::Option* rebuild =
      doctor
          ->add_flag("--rebuild", command.rebuild,
                     "Make assets, grids and sequences known again to a new or older database, as "
                     "far as their files tell what they are")
          ->excludes(calibrate);
  doctor->add_option("--tenant", command.tenant, "Whose they become, where there are API keys")
      ->needs(rebuild);
  doctor
      ->add_option("--data", command.data_dir,
                   "Directory of calibration.json and of the store; as of serve")
      ->envname("VOXELD_DATA")
      ->capture_default_str();
  doctor->add_option("--device", command.devices, "Devices to calibrate instead of all that work")
      ->delimiter(',')
      ->needs(calibrate);
  add_sandbox(*doctor, command.sandbox)->envname("VOXELD_SANDBOX");
  return doctor;
}

// Options of `keys add` and `keys set`.
void add_tenant_options(CLI::App& action, KeysCommand& command) {
  action
      .add_option("--weight", command.weight,
                  "The tenant's share beside others', for the scheduler (1)")
      ->check(CLI::Range(int64_t{1}, kKeyWeightMax));
  action.add_option("--rate", command.rate,
                    "Requests per second (10, 10/s) or minute (30/m); 0: any number");
  action.add_option("--queued-jobs", command.queued_jobs, "Jobs that may wait; 0: any number")
      ->check(CLI::Range(int64_t{0}, kQueuedJobsLimitMax));
  action
      .add_option("--bytes", command.bytes,
                  "Bytes of all that the tenant keeps, with an optional unit (500M, 20G); 0: any")
      ->transform(CLI::AsSizeValue(false))
      ->check(CLI::Range(int64_t{0}, kBytesLimitMax));
  action.add_option("--cells", command.cells, "Cells of one job, all its frames; 0: any number")
      ->check(CLI::Range(int64_t{0}, kCellsLimitMax));
}

CLI::App* add_keys(CLI::App& app, KeysCommand& command) {
  using Action = KeysCommand::Action;
  CLI::App* keys =
      app.add_subcommand("keys", "Make, list and revoke API keys, also while the daemon runs");
  keys->require_subcommand(1);
  keys->add_option("--data", command.data_dir, "Directory of serve, where the keys are")
      ->envname("VOXELD_DATA")
      ->capture_default_str();
  CLI::App* add = keys->add_subcommand("add", "Make a key and print it, this once");
  add->add_option("NAME", command.tenant, "Who gets it: a tenant may have several keys")
      ->required();
  add->add_flag("--admin", command.is_admin, "It sees what all tenants have and may cancel all");
  add->add_option("--expires", command.expires,
                  "When it ends: 12h, 30d or 8w from now, or a day such as 2030-12-31 (UTC)");
  CLI::App* set = keys->add_subcommand(
      "set", "Change weight and limits of the tenant of a key, on all of its keys");
  set->add_option("ID", command.id, "As listed: the part of the key after vxk_")->required();
  for (CLI::App* action : {add, set}) add_tenant_options(*action, command);
  CLI::App* list = keys->add_subcommand("list", "List keys, without their secrets");
  list->add_flag("--json", command.json, "As a JSON array");
  CLI::App* revoke = keys->add_subcommand("revoke", "End a key at once");
  revoke->add_option("ID", command.id, "As listed: the part of the key after vxk_")->required();
  CLI::App* rotate = keys->add_subcommand(
      "rotate-urls", "A new secret for links; those of the one before the last end");
  for (CLI::App* action : {add, set, list, revoke, rotate}) action->fallthrough();  // to --data
  set->callback([&command] { command.action = Action::kSet; });
  rotate->callback([&command] { command.action = Action::kRotateUrls; });
  add->callback([&command] { command.action = Action::kAdd; });
  list->callback([&command] { command.action = Action::kList; });
  revoke->callback([&command] { command.action = Action::kRevoke; });
  return keys;
}

// `voxeld --listen …` means `voxeld serve --listen …`.
std::vector<std::string> with_default_subcommand(int argc, const char* const* argv) {
  std::vector<std::string> arguments(argv + 1, argv + argc);
  const std::string first = arguments.empty() ? "" : arguments.front();
  const bool for_all = first == "-h" || first == "--help" || first == "--version";
  if (first.empty() || (first.starts_with('-') && !for_all)) {
    arguments.insert(arguments.begin(), "serve");
  }
  return {arguments.rbegin(), arguments.rend()};  // CLI11 takes them from the back
}

// CLI11 from 2.4 on leaves out the values of variables that it refuses. Here they are errors.
// Throws CLI::ParseError.
void check_variables(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    const char* value = std::getenv(option->get_envname().c_str());
    if (value == nullptr || *value == '\0' || option->count() > 0) continue;
    option->add_result(value);
    option->run_callback();
  }
  for (CLI::App* parsed : app.get_subcommands()) check_variables(*parsed);
}

// The host of HOST:PORT. nullopt without one of them, for an IPv6 address without brackets, and for
// what is no port: getaddrinfo() takes 65536 for 0.
std::optional<std::string_view> host_before_port(std::string_view address) {
  const size_t colon = address.rfind(':');
  if (colon == address.npos || colon == 0) return std::nullopt;
  const std::string_view host = address.substr(0, colon), port = address.substr(colon + 1);
  const bool is_bracketed = host.starts_with('[') && host.ends_with(']');
  if (!is_bracketed && host.find(':') != host.npos) return std::nullopt;
  if (!parse_digits<uint16_t>(port)) return std::nullopt;
  return host;
}

}  // namespace

Command parse_command_line(int argc, const char* const* argv) {
  CLI::App app("voxeld turns meshes into voxels and images, over HTTP.", "voxeld");
  app.require_subcommand(0, 1);
  bool print_version = false;
  app.add_flag("--version", print_version, "Print the version");
  ServeConfig serve_config;
  serve_config.data_dir = default_data_dir();
  WorkerCommand worker_command;
  DoctorCommand doctor_command;
  ProbeDeviceCommand probe_command;
  const CLI::App* serve = add_serve(app, serve_config);
  const CLI::App* worker = add_worker(app, worker_command);
  doctor_command.data_dir = default_data_dir();
  CalibrateDeviceCommand calibrate_command;
  const CLI::App* doctor = add_doctor(app, doctor_command);
  KeysCommand keys_command;
  keys_command.data_dir = default_data_dir();
  const CLI::App* keys = add_keys(app, keys_command);
  CLI::App* probe = app.add_subcommand("probe-device", "Open one device and describe it as JSON");
  probe->add_option("--device", probe_command.device)->required();
  add_sandbox(*probe, probe_command.sandbox);
  CLI::App* calibrate =
      app.add_subcommand("calibrate-device", "Measure one device and print what it found as JSON");
  calibrate->add_option("--device", calibrate_command.device)->required();
  TestDeviceCommand test_command;
  const CLI::App* test = add_test_device(app, test_command);
  const CLI::App* version = app.add_subcommand("version", "Print the version");
  try {
    app.parse(with_default_subcommand(argc, argv));
    check_variables(app);
  } catch (const CLI::ParseError& error) {
    return ExitCommand{app.exit(error) == 0 ? 0 : 64};  // EX_USAGE of sysexits.h
  }
  if (serve->parsed()) return serve_config;
  if (worker->parsed()) return worker_command;
  if (doctor->parsed()) return doctor_command;
  if (keys->parsed()) return keys_command;
  if (probe->parsed()) return probe_command;
  if (test->parsed()) return test_command;
  if (calibrate->parsed()) return calibrate_command;
  if (version->parsed() || print_version) return VersionCommand{};
  return ExitCommand{64};
}

std::string_view log_level_name(log::Level level) {
  for (const auto& [name, value] : log_levels()) {
    if (value == level) return name;
  }
  return "info";
}

Status check_listen_address(const std::string& flag, const std::string& address, bool allow_remote,
                            Guard guard) {
  const auto host = host_before_port(address);
  if (!host) {
    return Error{ErrorCode::kInvalidOption, flag,
                 "HOST:PORT, such as 127.0.0.1:8080 or [::1]:8080, and a port up to 65535",
                 address};
  }
  if (allow_remote || guard == Guard::kKeys || is_loopback_host(*host)) return {};
  return Error{ErrorCode::kInvalidOption,
               flag + " " + address + " can be reached from other machines, and " +
                   (guard == Guard::kNoKeys
                        ? "there are no API keys: make some with voxeld keys add, or pass "
                          "--allow-remote where a proxy guards it"
                        : "it needs no API key: pass --admin-allow-remote on a private network"),
               "127.0.0.1, [::1] or localhost", address};
}

}  // namespace voxeld
