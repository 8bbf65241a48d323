#include "server/worker/open_device.h"

#include "server/render/cpu/cpu_renderer.h"

namespace voxeld {

Result<OpenedDevice> open_device(const gpu::DeviceId& device, const std::string& shader_dir) {
  if (device.kind != gpu::DeviceKind::kCpu) return open_gl_device(device, shader_dir);
  OpenedDevice opened;
  opened.info = gpu::cpu_device_info();
  opened.renderer = std::make_unique<CpuRenderer>();
  opened.check = [](std::string_view) { return Status(); };
  return opened;
}

}  // namespace voxeld
