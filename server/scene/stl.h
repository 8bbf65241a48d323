// STL, as binary and as text: stl.cpp and stl_ascii.cpp.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "proto/result.h"
#include "server/scene/scene.h"

namespace voxeld {

// Whether the size is what a binary STL with its triangle count must have, 84 + 50 n, n > 0. Holds
// for files whose header begins with "solid", too.
bool is_binary_stl(std::span<const uint8_t> bytes);

Result<Scene> load_stl_binary(std::string_view name, std::span<const uint8_t> bytes);
// One part per "solid". Keywords in any case; what stands after "facet" up to the vertices is
// skipped, as normals are.
Result<Scene> load_stl_ascii(std::string_view name, std::string_view text);

}  // namespace voxeld
