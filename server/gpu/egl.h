// Contexts through EGL, which is loaded at run time. egl:N is the N-th of EGL's devices, in the
// order of enumerate_egl_devices(); llvmpipe and lavapipe (Zink) use Mesa's software device.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/device/pci_address.h"
#include "server/gpu/context.h"

namespace voxeld::gpu {

// Creates a context; `device` is kEgl, kLlvmpipe or kLavapipe. Errors: device-unavailable.
Result<std::unique_ptr<Context>> create_egl_context(const DeviceId& device);

// A device as EGL's enumeration describes it, without opening it.
struct EglDevice {
  std::string description;  // renderer or device file, if EGL reports one
  bool is_software = false;
  std::optional<PciAddress> address;  // as far as sysfs tells
};
// Lists EGL's devices: by their PCI address, then those without one, then software devices; else as
// EGL enumerates them. Errors: device-unavailable (no libEGL, no EGL_EXT_device_enumeration).
Result<std::vector<EglDevice>> enumerate_egl_devices();

// Shared with the OSMesa backend.
bool gl_debug_wanted();

}  // namespace voxeld::gpu
