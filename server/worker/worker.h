// The worker process: one device, one task at a time.
#pragma once

#include <string>

#include "server/gpu/device.h"

namespace voxeld {

struct WorkerConfig {
  std::string gateway;  // "unix:/path/to/tasks.sock"
  gpu::DeviceId device;
  std::string shader_dir;   // empty: embedded
  std::string data_dir;     // where calibration.json is looked for; empty: nowhere
  double part_seconds = 5;  // how often finished tiles are kept (Engine::part_interval)
};

// Connects, then claims and runs tasks until the gateway goes away or SIGTERM. Exit status: 0 after
// a clean end, 3 when the device cannot be opened (the supervisor reports it and backs off).
int worker_main(const WorkerConfig& config);

}  // namespace voxeld
