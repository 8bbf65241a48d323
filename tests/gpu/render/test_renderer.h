// The renderer of the device that VOXELD_TEST_DEVICE names.
#pragma once

#include <array>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string_view>

#include "proto/options/options.h"
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

// A style's shading of voxels alone: no occlusion, shadow or ground, before white, seen from 30 and
// 20 degrees.
inline RenderOptions plain_options(Style style, int width, int height) {
  RenderOptions options;
  options.style = style;
  options.width = width;
  options.height = height;
  options.occlusion = options.shadow = options.ground = false;
  options.background = {255, 255, 255, 255};
  return options;
}

// All that a request for a style gets.
inline RenderOptions options_in(Style style, int width, int height) {
  const StyleDefaults defaults = style_defaults(style);
  RenderOptions options = plain_options(style, width, height);
  options.projection = defaults.projection;
  options.azimuth_deg = defaults.azimuth_deg;
  options.elevation_deg = defaults.elevation_deg;
  options.occlusion = defaults.occlusion;
  options.shadow = defaults.shadow;
  options.ground = defaults.ground;
  options.background = {};
  return options;
}

inline std::array<uint8_t, 4> pixel(const RenderImage& image, int x, int y) {
  const size_t i = size_t{4} * static_cast<size_t>(y * image.width + x);
  return {image.rgba[i], image.rgba[i + 1], image.rgba[i + 2], image.rgba[i + 3]};
}

inline std::unique_ptr<Renderer> make_test_renderer() {
  if (test_device_is_cpu()) return std::make_unique<CpuRenderer>();
  return std::make_unique<GlRenderer>(gpu::test_context(), test_shaders());
}

}  // namespace voxeld
