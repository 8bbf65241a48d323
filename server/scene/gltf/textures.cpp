#include "server/scene/gltf/textures.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/scene/image.h"
#include "server/scene/mesh_error.h"
#include "server/scene/textures.h"

namespace voxeld {
namespace {

// A readable name of the image: its file, else its name, else its number.
std::string label_of(const GltfImage& image, int index) {
  if (!image.uri.empty() && !is_data_uri(image.uri)) return image.uri;
  if (!image.name.empty()) return image.name;
  return "images[" + std::to_string(index) + "]";
}

float finite_float(double x) {
  return is_coordinate(x) ? static_cast<float>(x) : 0.0f;
}

}  // namespace

std::vector<GltfImage> take_gltf_images(nlohmann::json& document) {
  std::vector<GltfImage> images;
  const auto elements = document.find("images");
  if (elements == document.end()) return images;
  for (nlohmann::json& element : *elements) {
    GltfImage image;
    if (element.contains("name")) image.name = element["name"].get<std::string>();
    if (element.contains("bufferView")) image.view = element["bufferView"].get<int>();
    image.uri = take_uri(element).value_or("");
    images.push_back(std::move(image));
  }
  return images;
}

int GltfTextures::use_material(int index) {
  if (index < 0) return -1;
  const auto found = materials_.find(index);
  if (found != materials_.end()) return found->second;
  const GltfMaterial& from = document_.materials[static_cast<size_t>(index)];
  Material to{.name = from.name, .base_color = from.base_color};
  if (from.base_color_given) scene_.colors_given = true;
  if (from.texture >= 0) {
    const GltfTexture& texture = document_.textures[static_cast<size_t>(from.texture)];
    const std::string needed_by =
        from.name.empty() ? "materials[" + std::to_string(index) + "]" : from.name;
    to.wrap_u = texture.wrap_u;
    to.wrap_v = texture.wrap_v;
    to.image = use_texture(from.texture, needed_by);
  }
  scene_.materials.push_back(std::move(to));
  const int at = static_cast<int>(scene_.materials.size()) - 1;
  materials_.emplace(index, at);
  return at;
}

int GltfTextures::use_texture(int index, const std::string& needed_by) {
  const GltfTexture& texture = document_.textures[static_cast<size_t>(index)];
  if (texture.image >= 0) return use_image(texture.image, needed_by);
  const std::string in = texture.unread_format.empty()
                             ? std::string()
                             : ", only in that of " + shown(texture.unread_format);
  return refuse("textures[" + std::to_string(index) + "]", needed_by, "missing-texture",
                "has no image in a format that voxeld reads" + in);
}

int GltfTextures::use_image(int image, const std::string& needed_by) {
  const auto found = loaded_.find(image);
  if (found != loaded_.end()) return found->second;
  const int at = load_image(image, needed_by);
  loaded_.emplace(image, at);
  return at;
}

Result<std::optional<std::vector<uint8_t>>> GltfTextures::image_bytes(const GltfImage& image) {
  using Bytes = std::optional<std::vector<uint8_t>>;
  if (image.uri.empty()) {
    if (image.view < 0) return Bytes();
    VOXELD_ASSIGN(const auto view, accessors_.view_bytes(image.view));
    return Bytes(std::vector<uint8_t>(view.begin(), view.end()));
  }
  if (!is_data_uri(image.uri)) return bundle_.find(image.uri, name_);
  Bytes bytes = decode_data_uri(image.uri);
  if (bytes) return bytes;
  return Error{ErrorCode::kMalformedImage, "broken data URI", "base64", ""};
}

int GltfTextures::load_image(int index, const std::string& needed_by) {
  cancel_point();
  const GltfImage& image = images_[static_cast<size_t>(index)];
  const std::string label = label_of(image, index);
  // Many elements may name one large file, so both successes and failures are limited.
  if (refused_count_ >= kSceneWarningsMax) return -1;
  if (budget_.is_spent()) return refuse(label, needed_by, "too-many-pixels", too_many_pixels());
  const auto bytes = image_bytes(image);
  if (!bytes) return refuse(label, needed_by, "bad-texture", bytes.error().message());
  if (!*bytes) return refuse(label, needed_by, "missing-texture", "is not in the upload");
  Image decoded{.name = label, .rgba = {}};
  if (options_.decode_images) {
    auto result = decode_image(label, **bytes, &budget_);
    if (!result && budget_.is_spent()) {
      return refuse(label, needed_by, "too-many-pixels", too_many_pixels());
    }
    if (!result) return refuse(label, needed_by, "bad-texture", result.error().message());
    decoded = *std::move(result);
  }
  scene_.images.push_back(std::move(decoded));
  return static_cast<int>(scene_.images.size()) - 1;
}

int GltfTextures::refuse(const std::string& label, const std::string& needed_by,
                         std::string_view code, const std::string& why) {
  ++refused_count_;
  add_warning(scene_, code, label + ", named by " + needed_by + ": " + why);
  if (scene_.missing_files.size() < kSceneWarningsMax) {
    scene_.missing_files.push_back({label, needed_by});
  }
  return -1;
}

// Transforms a texture coordinate. The specification's rotation appears counter-clockwise with v
// downwards. Its example (offset 0 1, rotation 90 degrees, scale 0.5) must land in the lower left
// quarter of the image.
glm::vec2 transformed_uv(const GltfTextureTransform& transform, const glm::dvec2& uv) {
  const double c = std::cos(transform.rotation_rad), s = std::sin(transform.rotation_rad);
  const glm::dvec2 scaled = transform.scale * uv;
  return {finite_float(c * scaled.x + s * scaled.y + transform.offset.x),
          finite_float(-s * scaled.x + c * scaled.y + transform.offset.y)};
}

}  // namespace voxeld
