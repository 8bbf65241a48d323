// The choice of `auto` with few probes.
#pragma once

#include <chrono>
#include <string>

#include "server/gpu/device.h"

namespace voxeld::gpu {

// The choice that choose_device() makes of all of probe_devices(), with as few probes as it takes.
AutoChoice probe_auto_device(const std::string& self_executable,
                             std::chrono::milliseconds timeout_each = std::chrono::seconds(20));

}  // namespace voxeld::gpu
