// A context through OSMesa (Mesa without a window system), loaded at run time.
#pragma once

#include <memory>

#include "proto/result.h"
#include "server/gpu/context.h"

namespace voxeld::gpu {

// Errors: device-unavailable.
Result<std::unique_ptr<Context>> create_osmesa_context(const DeviceId& device);

}  // namespace voxeld::gpu
