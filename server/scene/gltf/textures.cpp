#include "server/scene/gltf/textures.h"

#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/gltf/container.h"

namespace voxeld::gltf {
namespace {

constexpr int kKeepsAlpha = -1;

// The least alpha of a texel that reaches the cutoff together with the base colour's; 256: none.
int opaque_texel(const MaterialSource& material) {
  if (!material.alpha_cutoff) return kKeepsAlpha;
  int alpha = 0;
  while (alpha < 256 && alpha * double{material.base_color.a} < 255.0 * *material.alpha_cutoff)
    ++alpha;
  return alpha;
}

}  // namespace

int Textures::use_material(int index) {
  if (index < 0) return -1;
  const auto found = materials_.find(index);
  if (found != materials_.end()) return found->second;
  const MaterialSource& from = document_.materials[index];
  Material to{.name = from.name, .base_color = from.base_color};
  if (from.base_color_given) scene_.colors_given = true;
  if (from.texture >= 0) {
    const int sampler = document_.textures[from.texture].sampler;
    if (sampler >= 0) {
      to.wrap_u = document_.samplers[sampler].wrap_u;
      to.wrap_v = document_.samplers[sampler].wrap_v;
    }
    to.image = use_texture(from.texture, opaque_texel(from),
                           from.name.empty() ? at_index("materials", index) : from.name);
  }
  if (from.alpha_cutoff) {
    const bool is_opaque = to.image >= 0 || from.base_color.a >= *from.alpha_cutoff;
    to.base_color.a = is_opaque ? 1.0f : 0.0f;
  }
  scene_.materials.push_back(std::move(to));
  const int at = static_cast<int>(scene_.materials.size()) - 1;
  materials_.emplace(index, at);
  return at;
}

int Textures::use_texture(int index, int opaque_from, const std::string& needed_by) {
  const Texture& texture = document_.textures[index];
  if (texture.image < 0) {
    const std::string in = texture.unread_format.empty()
                               ? std::string()
                               : ", only in that of " + shown(texture.unread_format);
    return refuse(at_index("textures", index), needed_by, "missing-texture",
                  "has no image in a format that voxeld reads" + in);
  }
  const auto [found, is_new] = images_.try_emplace({texture.image, opaque_from}, -1);
  if (!is_new) return found->second;
  found->second = load_image(texture.image, needed_by);
  if (opaque_from != kKeepsAlpha && found->second >= 0) {
    std::vector<uint8_t>& rgba = scene_.images[found->second].rgba;
    for (size_t i = 3; i < rgba.size(); i += 4) {
      cancel_point_at(i - 3);
      rgba[i] = rgba[i] >= opaque_from ? 255 : 0;
    }
  }
  return found->second;
}

Result<std::optional<std::vector<uint8_t>>> Textures::image_bytes(const ImageSource& image) {
  using Bytes = std::optional<std::vector<uint8_t>>;
  if (image.uri.empty()) {
    if (image.view < 0) return Bytes();
    VOXELD_ASSIGN(const auto view, accessors_.view_bytes(image.view));
    return Bytes(copied_in_pieces(view.data(), view.size()));
  }
  if (!is_data_uri(image.uri)) return bundle_.find(image.uri, document_.name);
  Bytes bytes = decode_data_uri(image.uri);
  if (bytes) return bytes;
  return Error{ErrorCode::kMalformedImage, "broken data URI", "base64", ""};
}

int Textures::load_image(int index, const std::string& needed_by) {
  cancel_point();
  const ImageSource& image = document_.images[index];
  // A readable name: the file, else the image's name, else its number.
  std::string label = image.name.empty() ? at_index("images", index) : image.name;
  if (!image.uri.empty() && !is_data_uri(image.uri)) label = image.uri;
  // Many elements may name one large file, so both successes and failures are limited.
  if (refused_count_ >= kSceneWarningsMax) return -1;
  if (budget_.is_spent()) return refuse(label, needed_by, "too-many-pixels", too_many_pixels());
  const auto bytes = image_bytes(image);
  if (!bytes) return refuse(label, needed_by, "broken-texture", bytes.error().message());
  if (!*bytes) return refuse(label, needed_by, "missing-texture", "is not in the upload");
  if (!is_data_uri(image.uri)) {
    warn_assumed_file(scene_, bundle_, image.uri, document_.name, needed_by);
  }
  Image decoded{.name = label, .rgba = {}};
  if (options_.decode_images) {
    auto result = decode_image(label, **bytes, &budget_);
    if (!result && budget_.is_spent()) {
      return refuse(label, needed_by, "too-many-pixels", too_many_pixels());
    }
    if (!result) return refuse(label, needed_by, "broken-texture", result.error().message());
    decoded = *std::move(result);
  }
  scene_.images.push_back(std::move(decoded));
  return static_cast<int>(scene_.images.size()) - 1;
}

int Textures::refuse(const std::string& label, const std::string& needed_by, std::string_view code,
                     const std::string& why) {
  ++refused_count_;
  add_warning(scene_, code, label + ", named by " + needed_by + ": " + why);
  if (scene_.missing_files.size() < kSceneWarningsMax) {
    scene_.missing_files.push_back({label, needed_by});
  }
  return -1;
}

}  // namespace voxeld::gltf
