#include "server/gpu/environment.h"

#include <string_view>

#include "server/device/workarounds.h"

namespace voxeld::gpu {

void set_mesa_software_environment(ScopedEnvironment& environment) {
  const char* width = std::getenv("LP_NATIVE_VECTOR_WIDTH");
  if (width != nullptr && std::string_view(width) == "512" &&
      workaround_enabled(Workaround::kLpVectorWidth512)) {
    environment.unset("LP_NATIVE_VECTOR_WIDTH");
  }
  // The Vulkan loader's layers look for a Wayland display and complain on stderr if there is no
  // folder to look in. This one has no socket.
  if (std::getenv("XDG_RUNTIME_DIR") == nullptr) environment.set("XDG_RUNTIME_DIR", "/nonexistent");
}

}  // namespace voxeld::gpu
