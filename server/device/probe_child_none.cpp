// probe_device_main() in a build without GL.
#include <cstdio>

#include "server/device/device.h"

namespace voxeld::gpu {

int probe_device_main(const DeviceId& device, const std::function<Status()>&) {
  if (device.kind == DeviceKind::kCpu) {
    std::printf("{\"device\":\"cpu\",\"works\":true}\n");
  } else {
    std::printf(
        "{\"device\":\"%s\",\"works\":false,\"egl_device_count\":0,"
        "\"reason\":\"this voxeld was built without OpenGL\"}\n",
        device_name(device).c_str());
  }
  return 0;
}

}  // namespace voxeld::gpu
