// Loads the materials of a glTF document and their base colour images into a scene.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>
#include <nlohmann/json_fwd.hpp>

#include "proto/result.h"
#include "server/scene/gltf/accessor.h"
#include "server/scene/gltf/document.h"
#include "server/scene/image.h"
#include "server/scene/load.h"
#include "server/scene/scene.h"

namespace voxeld {

// One element of "images".
struct GltfImage {
  std::string name;
  std::string uri;  // empty: in the buffer view
  int view = -1;
};

// Moves "images" out of a document that passed check_gltf_schema, because their data: URIs are
// large.
std::vector<GltfImage> take_gltf_images(nlohmann::json& document);

// Decodes each image once, and only images of used materials. One per load; the objects it refers
// to must outlive it.
class GltfTextures {
 public:
  GltfTextures(std::string_view name, const GltfDocument& document, std::vector<GltfImage> images,
               GltfAccessors& accessors, const Bundle& bundle, const LoadOptions& options,
               Scene& scene)
      : name_(name),
        document_(document),
        images_(std::move(images)),
        accessors_(accessors),
        bundle_(bundle),
        options_(options),
        scene_(scene) {}

  // Index into scene.materials of the document's material, which is added on first use. A missing
  // or broken image adds a warning ("missing-texture", "bad-texture", "too-many-pixels") and an
  // entry of missing_files.
  int use_material(int material);

 private:
  int use_texture(int texture, const std::string& needed_by);
  int use_image(int image, const std::string& needed_by);
  int load_image(int image, const std::string& needed_by);
  // Returns nullopt for an absent file.
  Result<std::optional<std::vector<uint8_t>>> image_bytes(const GltfImage& image);
  // Adds the warning and returns -1.
  int refuse(const std::string& label, const std::string& needed_by, std::string_view code,
             const std::string& why);

  std::string_view name_;
  const GltfDocument& document_;
  std::vector<GltfImage> images_;
  GltfAccessors& accessors_;
  const Bundle& bundle_;
  LoadOptions options_;
  Scene& scene_;
  std::map<int, int> materials_, loaded_;  // document index to scene index
  PixelBudget budget_;
  size_t refused_count_ = 0;
};

// Applies KHR_texture_transform to a texture coordinate whose origin is the top left.
glm::vec2 transformed_uv(const GltfTextureTransform& transform, const glm::dvec2& uv);

}  // namespace voxeld
