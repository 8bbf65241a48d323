// Finds the file of a bundle that a mesh refers to. Mesh files name their textures with
// backslashes, absolute paths of the author's disk, another case, or as URIs. Without this, meshes
// would lose their colours.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace voxeld {

// The name with slashes for backslashes, without "." parts and doubled slashes, ".." resolved.
// nullopt for a name that is empty, absolute ("/a", "C:/a"), or leaves the bundle.
std::optional<std::string> normalized_name(std::string_view name);
// The part of a path after the last slash or backslash.
std::string_view base_name(std::string_view name);
// Decodes %41 to A. Sequences that are not two hex digits stay as they are.
std::string percent_decoded(std::string_view text);

// Index in `names` (normalized) of the file that `reference` means in the file `from`. The order
// is: relative to the folder of `from`, from the top, both without regard to case, all again
// percent-decoded, and last by the base name alone. nullopt if none matches, and for data: URIs.
std::optional<size_t> resolve_reference(std::span<const std::string> names,
                                        std::string_view reference, std::string_view from);

}  // namespace voxeld
