// voxeld: serve, worker, doctor, keys, version. Each command has its own file.
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>
#include <type_traits>
#include <variant>

#include "proto/standard_descriptors.h"
#include "proto/version.h"
#include "server/base/log.h"
#include "server/config.h"
#include "server/device/device.h"
#include "server/doctor.h"
#include "server/exit_status.h"
#include "server/keys.h"
#include "server/serve.h"
#include "server/worker/device/calibrate_device.h"
#include "server/worker/device/test_device.h"
#include "server/worker/worker.h"
#include "server/worker/worker_sandbox.h"

namespace voxeld {
namespace {

// The file that runs, for starting it again: argv[0] may be a name that was found in PATH.
std::string self_executable(const char* argv0) {
  std::error_code failed;
  const auto path = std::filesystem::read_symlink("/proc/self/exe", failed);
  return failed ? argv0 : path.string();
}

int usage_error(const Error& error) {
  std::fprintf(stderr, "voxeld: %s\n", error.message().c_str());
  return kExitUsage;
}

int run_worker(const WorkerCommand& command) {
  const auto device = gpu::parse_device(command.device);
  if (!device) return usage_error(device.error());
  log::configure(command.log_level, "worker " + gpu::device_name(*device));
  return worker_main({command.gateway, *device, command.shader_dir, command.data_dir,
                      command.part_seconds, sandbox_mode(command.sandbox)});
}

int run_probe(const ProbeDeviceCommand& command) {
  const auto device = gpu::parse_device(command.device);
  if (!device) return usage_error(device.error());
  WorkerSandbox sandbox(sandbox_mode(command.sandbox));
  return gpu::probe_device_main(*device, [&] { return sandbox.restrict_to({}, "", ""); });
}

int run_calibrate(const CalibrateDeviceCommand& command) {
  const auto device = gpu::parse_device(command.device);
  if (!device) return usage_error(device.error());
  return calibrate_device_main(*device);
}

int run_test(const TestDeviceCommand& command) {
  const auto device = gpu::parse_device(command.device);
  if (!device) return usage_error(device.error());
  WorkerSandbox sandbox(sandbox_mode(command.sandbox));
  return test_device_main(
      {.device = *device,
       .shader_dir = command.shader_dir,
       .data_dir = command.data_dir,
       .skipped = command.skipped,
       .enter_sandbox =
           [&] { return sandbox.restrict_to({}, command.data_dir, command.shader_dir); },
       .close_sandbox = [&] { return sandbox.close(); }});
}

int run(const Command& command, const std::string& self) {
  return std::visit(
      [&](const auto& chosen) -> int {
        using Chosen = std::decay_t<decltype(chosen)>;
        if constexpr (std::is_same_v<Chosen, ServeConfig>) return serve_main(chosen, self);
        if constexpr (std::is_same_v<Chosen, WorkerCommand>) return run_worker(chosen);
        if constexpr (std::is_same_v<Chosen, DoctorCommand>) return doctor_main(self, chosen);
        if constexpr (std::is_same_v<Chosen, KeysCommand>) return keys_main(chosen);
        if constexpr (std::is_same_v<Chosen, ProbeDeviceCommand>) return run_probe(chosen);
        if constexpr (std::is_same_v<Chosen, CalibrateDeviceCommand>) return run_calibrate(chosen);
        if constexpr (std::is_same_v<Chosen, TestDeviceCommand>) return run_test(chosen);
        if constexpr (std::is_same_v<Chosen, ExitCommand>) return chosen.status;
        if constexpr (std::is_same_v<Chosen, VersionCommand>) {
          std::printf("voxeld %s\n", std::string(version()).c_str());
          return 0;
        }
      },
      command);
}

}  // namespace
}  // namespace voxeld

int main(int argc, char** argv) {
  voxeld::keep_standard_descriptors();
  return voxeld::run(voxeld::parse_command_line(argc, argv), voxeld::self_executable(argv[0]));
}
