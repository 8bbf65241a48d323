// The choice of `auto` with few probes.
#pragma once

#include "server/device/device.h"

namespace voxeld::gpu {

// The choice that choose_device() makes of all of probe_devices(), with as few probes as it takes.
AutoChoice probe_auto_device(const ProbeSettings& settings);

}  // namespace voxeld::gpu
