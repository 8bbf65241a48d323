// Loads STL, binary (stl.cpp) and text (stl_ascii.cpp).
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "proto/result.h"
#include "server/scene/core/scene.h"

namespace voxeld {

// Whether the size fits a binary STL with its triangle count: 84 + 50 n, n > 0. The header of such
// a file may also begin with "solid".
bool is_binary_stl(std::span<const uint8_t> bytes);

Result<Scene> load_stl_binary(std::string_view name, std::span<const uint8_t> bytes);
// Makes one part per "solid". Keywords may have any case. Text between "facet" and the vertices is
// skipped, normals included.
Result<Scene> load_stl_ascii(std::string_view name, std::string_view text);

}  // namespace voxeld
