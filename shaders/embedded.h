// The shader sources that are built into the binary; see embed.cmake.
#pragma once

#include <span>
#include <string_view>

namespace voxeld::shaders {

struct EmbeddedShader {
  std::string_view name;    // below shaders/: "raymarch/dda.glsl"
  std::string_view sha256;  // of the text, 64 hexadecimal digits
  std::string_view text;
};

// In the order of shaders/CMakeLists.txt, which is sorted by name.
std::span<const EmbeddedShader> embedded_shaders();

}  // namespace voxeld::shaders
