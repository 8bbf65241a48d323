// The open_gl_device() of a build without GL.
#include "server/worker/device/open_device.h"

namespace voxeld {

Result<OpenedDevice> open_gl_device(const gpu::DeviceId& device, const std::string&) {
  return Error{ErrorCode::kDeviceUnavailable, "this voxeld was built without OpenGL", "cpu",
               gpu::device_name(device)};
}

}  // namespace voxeld
