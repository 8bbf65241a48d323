// The command line and the environment as plain data.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "proto/limits.h"
#include "proto/result.h"
#include "server/base/log.h"

namespace voxeld {

struct ServeConfig {
  std::string listen = "127.0.0.1:8080";
  std::string admin_listen = "127.0.0.1:8081";  // "none": no admin port
  bool allow_remote = false;
  bool admin_allow_remote = false;
  std::filesystem::path data_dir;  // default: $XDG_STATE_HOME or ~/.local/state, then /voxeld
  std::vector<std::string> devices = {"auto"};
  int64_t upload_bytes_max = limits::kUploadBytesMax;
  int queued_jobs_max = limits::kQueuedJobsMax;
  int request_threads = 64;
  int connections_max = 16384;
  int connections_per_address = 256;         // neither loopback nor a trusted proxy; 0: any number
  std::vector<std::string> trusted_proxies;  // whose X-Forwarded-For is believed
  std::vector<std::string> public_hosts;     // names, beside loopback, that clients call it by
  std::vector<std::string> cors_origins;     // whose web pages may read responses
  int workers_per_device = 3;
  bool is_fair = true;           // --scheduler fair
  int64_t memory_bytes_max = 0;  // 0: three quarters of what the machine has
  int64_t store_bytes_max = 0;   // 0: no limit; so are the days
  int64_t disk_reserve_bytes = int64_t{1} << 30;
  double keep_results_days = 0;
  double keep_assets_days = 0;
  double keep_jobs_days = 30;
  double keep_orphans_days = 7;
  bool adopts_store = false;           // --adopt
  bool forgets_keys = false;           // --forget-keys
  std::filesystem::path address_file;  // address_file.h; empty: none
  double exit_when_idle_seconds = 0;   // without requests and jobs; 0: never
  double drain_seconds = 10.0;         // how long running requests may continue after SIGTERM
  double part_seconds = 5.0;           // how often finished tiles of long jobs are stored
  std::string shader_dir;
  std::filesystem::path web_dir;  // files of the page; empty: those built in
  std::string sandbox = "auto";   // of workers: auto, require or off
  // auto (tenant where several tenants have keys, else none), tenant, task or none
  std::string worker_isolation = "auto";
  int64_t worker_memory_bytes_max = 0;   // 0: three quarters of what there is
  int64_t worker_scratch_bytes_max = 0;  // 0: a quarter of the disk
  double job_seconds_max = 86'400;
  log::Level log_level = log::Level::kInfo;
};

struct WorkerCommand {
  std::string gateway;
  std::string device;
  std::string shader_dir;
  std::string data_dir;
  double part_seconds = 5.0;
  std::string sandbox = "auto";
  log::Level log_level = log::Level::kInfo;
};

struct DoctorCommand {
  bool json = false;
  bool calibrate = false;
  bool store = false;                 // look at the data directory instead of the devices
  bool rebuild = false;               // make a database for the blobs of the data directory
  std::optional<std::string> tenant;  // rebuild: whose what is found becomes
  std::filesystem::path data_dir;     // of calibration.json; default: as of serve
  std::vector<std::string> devices;   // to calibrate; empty: all that work
  std::string sandbox = "auto";       // of workers, in which devices are probed
};

struct KeysCommand {
  enum class Action { kAdd, kSet, kList, kRevoke, kRotateUrls } action = Action::kList;
  std::filesystem::path data_dir;  // default: as of serve
  std::string tenant;              // kAdd
  bool is_admin = false;
  std::string expires;  // as it was given; empty: never
  // kAdd and kSet; what is not given stays, for a tenant that has a key.
  std::optional<int64_t> weight;
  std::optional<std::string> rate;  // as it was given: "10/s"
  std::optional<int64_t> queued_jobs, bytes, cells;
  bool json = false;  // kList
  std::string id;     // kSet, kRevoke
};

struct CalibrateDeviceCommand {
  std::string device;
};

struct ProbeDeviceCommand {
  std::string device;
  std::string sandbox = "auto";
};

struct TestDeviceCommand {
  std::string device;
  std::string sandbox = "auto";
  std::string shader_dir;
  std::filesystem::path data_dir;    // where known outcomes are; empty: test in any case
  std::vector<std::string> skipped;  // parts that are not tested
};

struct VersionCommand {};

// Help was printed, or an error: end with this status.
struct ExitCommand {
  int status = 0;
};

using Command =
    std::variant<ServeConfig, WorkerCommand, DoctorCommand, KeysCommand, ProbeDeviceCommand,
                 CalibrateDeviceCommand, TestDeviceCommand, VersionCommand, ExitCommand>;

// Parses arguments, then VOXELD_… variables for flags that are not given, then defaults. Prints
// help and errors itself. Without a subcommand: serve.
Command parse_command_line(int argc, const char* const* argv);

std::string_view log_level_name(log::Level level);

// The protection of a listener: API keys, none though there could be some, or nothing (the admin
// port).
enum class Guard { kKeys, kNoKeys, kNone };

// Without keys voxeld listens on loopback unless told otherwise. Errors: invalid-option with the
// reason.
Status check_listen_address(const std::string& flag, const std::string& address, bool allow_remote,
                            Guard guard);

}  // namespace voxeld
