// Variants of a glTF document's materials: KHR_materials_variants.
#pragma once

#include <string_view>

#include "proto/result.h"
#include "server/scene/gltf/document.h"

namespace voxeld::gltf {

// Gives each primitive its material in the variant of this name, else of this number from 0. A
// primitive that the variant does not name keeps its own. Errors: invalid-option with the names
// that the document has; malformed-mesh for numbers of variants that do not exist.
Status choose_variant(Document& document, std::string_view name_or_number);

}  // namespace voxeld::gltf
