// The JSON of a glTF file as a tree that later steps can trust: bounded, and checked against the
// part of the glTF 2.0 schema that voxeld reads.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "proto/result.h"

namespace voxeld {

// JSON values in one file: malformed-mesh above. A value costs up to about 100 bytes of memory.
inline constexpr size_t kGltfJsonValuesMax = 8'000'000;
// Elements of one top-level array (nodes, accessors, …): malformed-mesh above. An element costs up
// to some 2 KB of memory.
inline constexpr size_t kGltfObjectsMax = 262'144;

// The first 200 bytes of a library's message, other than printable ASCII as '?': libraries quote
// the file, which need not be UTF-8, and an answer must be.
std::string printable(std::string_view message);

// Parses after a scan of depth (limits::kGltfJsonDepthMax) and number of values, so that neither
// the stack nor the memory depends on what a file pretends. Errors: malformed-mesh with the byte.
Result<nlohmann::json> parse_gltf_json(std::string_view name, std::string_view text);

// Checks asset.version and the extensions that the file requires: the shape must be whole without
// those that are not read. Errors: malformed-mesh, unsupported-feature naming the extension or the
// version.
Status check_gltf_version(std::string_view name, const nlohmann::json& document);

// Checks the type and range of every property that voxeld reads, and that every index names an
// element that exists. Errors: malformed-mesh with the path, e.g. "accessors[3].bufferView".
Status check_gltf_schema(std::string_view name, const nlohmann::json& document);
// The same of "animations", which a static scene does without.
Status check_gltf_animation_schema(std::string_view name, const nlohmann::json& document);

}  // namespace voxeld
