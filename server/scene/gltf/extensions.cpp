#include "server/scene/gltf/extensions.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <set>

#include "server/scene/mesh_error.h"

namespace voxeld {
namespace {

constexpr std::string_view kReadExtensions =
    "KHR_mesh_quantization, KHR_texture_transform, KHR_materials_*, EXT_texture_webp";

using Names = std::set<std::string, std::less<>>;

// Collects the members of every "extensions" outside extras. The recursion is at most
// limits::kGltfJsonDepthMax deep.
void add_used(const nlohmann::json& value, Names& names) {
  if (value.is_array()) {
    for (const nlohmann::json& element : value) add_used(element, names);
  }
  if (!value.is_object()) return;
  for (const auto& [key, member] : value.items()) {
    if (key == "extras") continue;
    if (key == "extensions" && member.is_object()) {
      for (const auto& [extension, unused] : member.items()) names.insert(extension);
    }
    add_used(member, names);
  }
}

}  // namespace

bool is_read_extension(std::string_view name) {
  constexpr std::array kNames = {
      std::string_view("EXT_texture_webp"),      std::string_view("KHR_animation_pointer"),
      std::string_view("KHR_lights_punctual"),   std::string_view("KHR_mesh_quantization"),
      std::string_view("KHR_texture_transform"), std::string_view("KHR_xmp_json_ld"),
  };
  return name.starts_with("KHR_materials_") ||
         std::find(kNames.begin(), kNames.end(), name) != kNames.end();
}

bool is_texture_extension(std::string_view name) {
  return name.starts_with("KHR_texture_") || name.starts_with("EXT_texture_") ||
         name.starts_with("MSFT_texture_");
}

Error unread_extension(std::string_view name, std::string_view where, std::string_view what,
                       std::string_view extension) {
  std::string detail(name);
  if (!where.empty()) detail.append(" ").append(where);
  detail.append(": ").append(what);
  return {ErrorCode::kUnsupportedFeature, std::move(detail),
          "extensions that voxeld reads: " + std::string(kReadExtensions), shown(extension)};
}

void warn_about_extensions(std::string_view name, const nlohmann::json& document, Scene& scene) {
  Names names;
  for (const char* list : {"extensionsUsed", "extensionsRequired"}) {
    const auto listed = document.find(list);
    if (listed == document.end()) continue;
    for (const nlohmann::json& extension : *listed) {
      names.insert(extension.get_ref<const std::string&>());
    }
  }
  add_used(document, names);
  for (const std::string& extension : names) {
    if (is_read_extension(extension)) continue;
    add_warning(scene, "ignored-extension",
                std::string(name) + ": the glTF extension " + shown(extension) + " is not read" +
                    (is_texture_extension(extension) ? "; its textures are left out" : ""));
  }
}

}  // namespace voxeld
