// How a mesh's reference to another file finds that file in a bundle. Mesh files name their
// textures with backslashes, absolute paths of somebody's disk, other upper and lower case, or as
// URIs; the most common complaint about such tools is "no colours".
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace voxeld {

// Backslashes as slashes, without "." parts and doubled slashes, ".." resolved. nullopt for a name
// that is empty, absolute ("/a", "C:/a"), or leaves the bundle.
std::optional<std::string> normalized_name(std::string_view name);
// The last part of a path, after the last slash or backslash.
std::string_view base_name(std::string_view name);
// %41 as A; sequences that are not two hex digits stay as they are.
std::string percent_decoded(std::string_view text);

// Index in `names` (normalized) of the file that `reference` means, seen from the file `from`.
// In this order: relative to the folder of `from`, from the top, both without regard to case, all
// again with the reference percent-decoded, and last by the base name alone. nullopt for none, and
// for data: URIs.
std::optional<size_t> resolve_reference(std::span<const std::string> names,
                                        std::string_view reference, std::string_view from);

}  // namespace voxeld
