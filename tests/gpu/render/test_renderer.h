// The renderer of the device that VOXELD_TEST_DEVICE names.
#pragma once

#include <cstdlib>
#include <memory>
#include <string_view>

#include "server/gpu/shader_library.h"
#include "server/render/cpu/cpu_renderer.h"
#include "server/render/gl_renderer.h"
#include "tests/gpu/context/test_device.h"

namespace voxeld {

inline bool test_device_is_cpu() {
  const char* name = std::getenv("VOXELD_TEST_DEVICE");
  return name != nullptr && std::string_view(name) == "cpu";
}

inline gpu::ShaderLibrary& test_shaders() {
  static gpu::ShaderLibrary shaders(gpu::test_context());
  return shaders;
}

inline std::unique_ptr<Renderer> make_test_renderer() {
  if (test_device_is_cpu()) return std::make_unique<CpuRenderer>();
  return std::make_unique<GlRenderer>(gpu::test_context(), test_shaders());
}

}  // namespace voxeld
