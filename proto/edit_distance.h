// Levenshtein distance of texts, for suggestions.
#pragma once

#include <cstddef>
#include <string_view>

namespace voxeld {

// The number of bytes to insert, remove or replace that makes `a` equal to `b`.
size_t edit_distance(std::string_view a, std::string_view b);

}  // namespace voxeld
