#include "server/scene/gltf/variants.h"

#include <algorithm>
#include <optional>
#include <string>

#include "proto/text/number_text.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"

namespace voxeld::gltf {
namespace {

constexpr size_t kListedVariantsMax = 20;

std::string listed_variants(const std::vector<std::string>& names) {
  std::string text;
  for (size_t i = 0; i < names.size() && i < kListedVariantsMax; ++i) {
    text += (i == 0 ? "" : ", ") + shown(names[i]);
  }
  if (names.size() > kListedVariantsMax) {
    text += " and " + std::to_string(names.size() - kListedVariantsMax) + " more";
  }
  return text;
}

std::optional<size_t> find_variant(const std::vector<std::string>& names,
                                   std::string_view name_or_number) {
  const auto named = std::ranges::find(names, name_or_number);
  if (named != names.end()) return static_cast<size_t>(named - names.begin());
  const auto number = parse_integer(name_or_number);
  if (!number || *number < 0 || static_cast<size_t>(*number) >= names.size()) return std::nullopt;
  return static_cast<size_t>(*number);
}

}  // namespace

Status choose_variant(Document& document, std::string_view name_or_number) {
  const std::vector<std::string>& names = document.variants;
  const std::optional<size_t> chosen = find_variant(names, name_or_number);
  if (!chosen) {
    if (names.empty()) {
      return Error{ErrorCode::kInvalidOption, "variant: the file has no variants of materials", "",
                   shown(name_or_number)};
    }
    return Error{ErrorCode::kInvalidOption, "variant: there is none of this name or number",
                 listed_variants(names) + ", or " + index_text(names.size(), "variants"),
                 shown(name_or_number)};
  }
  for (size_t m = 0; m < document.meshes.size(); ++m) {
    std::vector<Primitive>& primitives = document.meshes[m].primitives;
    for (size_t p = 0; p < primitives.size(); ++p) {
      for (const VariantMaterial& mapping : primitives[p].variants) {
        for (const int variant : mapping.variants) {
          const auto at = static_cast<size_t>(variant);
          if (at >= names.size()) {
            return document.malformed(
                at_index("meshes", m) + "." + at_index("primitives", p) + " variants",
                "wrong value", index_text(names.size(), "variants"), std::to_string(variant));
          }
          if (at == *chosen) primitives[p].material = mapping.material;
        }
      }
    }
  }
  return {};
}

}  // namespace voxeld::gltf
