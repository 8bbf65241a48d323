// Suggestions for misspelt names: of options, query parameters, members, commands.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "proto/result.h"

namespace voxeld {

// Edits from one text to the other: letters inserted, removed, replaced or swapped with their
// neighbour (optimal string alignment distance).
size_t edit_distance(std::string_view a, std::string_view b);

// The known name with the fewest edits, the first of equals. Empty if that takes more than one edit
// for each three letters of `name`, and for a name of one letter.
std::string_view near_miss(std::string_view name, std::span<const std::string_view> known);

// unknown-option: "unknown option 'siez'; did you mean 'size'?". Without a near miss the error
// lists the known names, at most the nearest three of many. `what`: "option", "parameter".
Error unknown_name(std::string_view what, std::string_view name,
                   std::span<const std::string_view> known);

}  // namespace voxeld
