// Which glTF extensions voxeld reads, and which it may leave out without loss.
#pragma once

#include <algorithm>
#include <array>
#include <string_view>

namespace voxeld {

inline constexpr std::string_view kReadExtensions =
    "KHR_mesh_quantization, KHR_texture_transform, KHR_materials_*, EXT_texture_webp";

// True for extensions that are read, or that say nothing about the shape and the base colour.
inline bool is_read_extension(std::string_view name) {
  constexpr std::array kNames = {
      std::string_view("EXT_texture_webp"),      std::string_view("KHR_animation_pointer"),
      std::string_view("KHR_lights_punctual"),   std::string_view("KHR_mesh_quantization"),
      std::string_view("KHR_texture_transform"), std::string_view("KHR_xmp_json_ld"),
  };
  return name.starts_with("KHR_materials_") ||
         std::find(kNames.begin(), kNames.end(), name) != kNames.end();
}

}  // namespace voxeld
