// Loads STL, binary (stl.cpp) and text (ascii.cpp).
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include <glm/vec4.hpp>

#include "proto/result.h"
#include "server/scene/core/scene.h"

namespace voxeld {

// Whether the size fits a binary STL with its triangle count: 84 + 50 n, n > 0. The header of such
// a file may also begin with "solid".
bool is_binary_stl(std::span<const uint8_t> bytes);
// Whether the size is that of a header, which is not text, and of whole triangles alone, which look
// like some: unit or no normals, corners apart. For a count that is wrong.
bool is_binary_stl_of_wrong_count(std::span<const uint8_t> bytes);
// The colour, in linear light, of a number with 5 bits each of red (highest), green and blue.
glm::vec4 stl_color(uint32_t bits);

Result<Scene> load_stl_binary(std::string_view name, std::span<const uint8_t> bytes);
// Makes one part per "solid". Reads words, not lines: keywords may have any case, and "end loop"
// is "endloop". Text between "facet" and the vertices is skipped, normals included; other words
// between keywords are left out with the warning "ignored-words".
Result<Scene> load_stl_ascii(std::string_view name, std::string_view text);

}  // namespace voxeld
