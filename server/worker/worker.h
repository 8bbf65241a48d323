// The worker process: one device, one task at a time.
#pragma once

#include <filesystem>
#include <string>

#include "server/device/device.h"
#include "server/worker/gateway/device_slice.h"
#include "server/worker/gateway/task_client.h"
#include "server/worker/task/engine.h"
#include "server/worker/worker_sandbox.h"

namespace voxeld {

struct WorkerConfig {
  std::string gateway;  // "unix:/path/to/tasks.sock"
  gpu::DeviceId device;
  std::string shader_dir;   // empty: embedded
  std::string data_dir;     // directory of calibration.json; empty: none
  double part_seconds = 5;  // seconds between two parts (Engine::part_interval)
  SandboxMode sandbox = SandboxMode::kAuto;
};

// Connects, then claims and runs tasks until the gateway goes away or SIGTERM arrives. Exit status:
// 0 after a clean end, 3 if the device cannot be opened (the supervisor reports it and backs off).
int worker_main(const WorkerConfig& config);

// Claims and runs tasks; returns the process's exit status. Part of worker_main(). `time slices`:
// as for run_task().
int serve_tasks(Engine& engine, TaskClient& client, SliceClient* slices,
                const std::filesystem::path& scratch);

}  // namespace voxeld
