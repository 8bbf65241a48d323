// Contexts through EGL, which is opened at run time: egl:N on the N-th device of EGL's enumeration,
// llvmpipe and lavapipe (Zink) on Mesa's software device.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/gpu/context.h"

namespace voxeld::gpu {

// `device` is kEgl, kLlvmpipe or kLavapipe. Errors: device-unavailable.
Result<std::unique_ptr<Context>> create_egl_context(const DeviceId& device);

// What EGL's device enumeration says, without opening any.
struct EglDevice {
  std::string description;  // renderer or device file, as far as EGL tells
  bool is_software = false;
};
// Errors: device-unavailable (no libEGL, no EGL_EXT_device_enumeration).
Result<std::vector<EglDevice>> enumerate_egl_devices();

// Shared with the other backend.
bool gl_debug_wanted();
bool is_software_renderer(std::string_view renderer);

}  // namespace voxeld::gpu
