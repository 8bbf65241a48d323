#include "server/worker/device/open_device.h"

#include "server/render/cpu/cpu_renderer.h"

namespace voxeld {

Result<OpenedDevice> open_device(const gpu::DeviceId& device, const std::string& shader_dir) {
  OpenedDevice opened;
  if (device.kind == gpu::DeviceKind::kCpu) {
    opened.info = gpu::cpu_device_info();
    opened.check = [](std::string_view) { return Status(); };
  } else {
    VOXELD_ASSIGN(opened, open_gl_device(device, shader_dir));
  }
  opened.cpu_renderer = std::make_unique<CpuRenderer>();
  return opened;
}

}  // namespace voxeld
