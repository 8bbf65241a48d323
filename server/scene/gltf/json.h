// The JSON of a glTF file as a tree that later steps can trust: bounded, and checked against the
// part of the glTF 2.0 schema that voxeld reads.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "proto/result.h"

namespace voxeld {

// JSON values in one file; a value takes up to about 100 bytes of memory. More: malformed-mesh.
inline constexpr size_t kGltfJsonValuesMax = 8'000'000;
// Elements of one top-level array (nodes, accessors, …); an element takes up to some 2 KB of
// memory. More: malformed-mesh.
inline constexpr size_t kGltfObjectsMax = 262'144;

// The first 200 bytes of a library's message, with '?' for anything but printable ASCII. Libraries
// quote the file, which need not be UTF-8, but a response must be.
std::string printable(std::string_view message);

// Parses after a scan of depth (limits::kGltfJsonDepthMax) and number of values, so hostile text
// can exhaust neither stack nor memory. Errors: malformed-mesh with the byte.
Result<nlohmann::json> parse_gltf_json(std::string_view name, std::string_view text);

// Checks asset.version and the extensions that the file requires. The shape must be complete
// without the extensions that are not read. Errors: malformed-mesh, unsupported-feature naming the
// extension or the version.
Status check_gltf_version(std::string_view name, const nlohmann::json& document);

// Checks the type and range of every property that voxeld reads, and that every index names an
// existing element. Errors: malformed-mesh with the path, e.g. "accessors[3].bufferView".
Status check_gltf_schema(std::string_view name, const nlohmann::json& document);
// The same check of "animations", which a static scene does not need.
Status check_gltf_animation_schema(std::string_view name, const nlohmann::json& document);

}  // namespace voxeld
