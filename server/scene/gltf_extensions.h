// Which glTF extensions voxeld reads, which it may leave out without loss, and what users are told
// of the others.
#pragma once

#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "proto/result.h"
#include "server/scene/scene.h"

namespace voxeld {

// True for extensions that are read, or that say nothing about the shape and the base colour.
bool is_read_extension(std::string_view name);
// True for formats of textures: without them the shape is whole, and colours are missing.
bool is_texture_extension(std::string_view name);

// unsupported-feature: without `extension`, what stands at `where` cannot be read.
Error unread_extension(std::string_view name, std::string_view where, std::string_view what,
                       std::string_view extension);

// Of a file that passed check_gltf_schema: the warning "ignored-extension" for each extension that
// is not read, whether the file lists it or only uses it.
void warn_about_extensions(std::string_view name, const nlohmann::json& document, Scene& scene);

}  // namespace voxeld
