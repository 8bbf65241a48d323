// glTF extensions: those that voxeld reads, those it can ignore without loss, and the messages
// about the others.
#pragma once

#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "proto/result.h"
#include "server/scene/scene.h"

namespace voxeld {

// Whether the extension is read, or does not affect shape and base colour.
bool is_read_extension(std::string_view name);
// Whether the extension is a texture format. Without it the shape is complete, but colours are
// missing.
bool is_texture_extension(std::string_view name);

// unsupported-feature: the item at `where` cannot be read without `extension`.
Error unread_extension(std::string_view name, std::string_view where, std::string_view what,
                       std::string_view extension);

// Adds the warning "ignored-extension" for each extension that is not read, whether the file lists
// it or only uses it. The document must have passed check_gltf_schema.
void warn_about_extensions(std::string_view name, const nlohmann::json& document, Scene& scene);

}  // namespace voxeld
