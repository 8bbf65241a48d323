// The JSON text of a glTF as a tree of values, with cancellation points between them.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string_view>

#include "proto/result.h"

namespace voxeld::gltf {

// JSON values in one file; a value takes up to about 100 bytes of memory. More: malformed-mesh.
inline constexpr size_t kJsonValuesMax = 8'000'000;
// Parses the text of the file `name`. Errors: malformed-mesh, also if the value is no object, nests
// deeper than limits::kGltfJsonDepthMax or has more than kJsonValuesMax values.
Result<nlohmann::json> parse_json(std::string_view name, std::string_view text);
// Frees the values of a tree one by one. Its destructor may take a second.
void free_json(nlohmann::json& value);

}  // namespace voxeld::gltf
