// Loads the materials of a glTF document and their base colour images into a scene.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/result.h"
#include "server/scene/core/loaders.h"
#include "server/scene/core/scene.h"
#include "server/scene/gltf/accessor.h"
#include "server/scene/gltf/document.h"
#include "server/scene/images/image.h"

namespace voxeld::gltf {

// Decodes each image once, and only images of used materials. One per load; the objects it refers
// to must outlive it.
class Textures {
 public:
  Textures(const Document& document, Accessors& accessors, const Bundle& bundle,
           const LoadOptions& options, Scene& scene)
      : document_(document),
        accessors_(accessors),
        bundle_(bundle),
        options_(options),
        scene_(scene) {}

  // Index into scene.materials of the document's material, which is added on first use; -1 for -1.
  // A missing or broken image adds a warning ("missing-texture", "broken-texture",
  // "too-many-pixels") and an entry of missing_files.
  int use_material(int material);

 private:
  // Texels whose alpha is at least `opaque_from` become opaque, others transparent; kKeepsAlpha:
  // none.
  int use_texture(int texture, int opaque_from, const std::string& needed_by);
  int load_image(int image, const std::string& needed_by);
  // Returns nullopt for an absent file.
  Result<std::optional<std::vector<uint8_t>>> image_bytes(const ImageSource& image);
  // Adds the warning and returns -1.
  int refuse(const std::string& label, const std::string& needed_by, std::string_view code,
             const std::string& why);

  const Document& document_;
  Accessors& accessors_;
  const Bundle& bundle_;
  LoadOptions options_;
  Scene& scene_;
  std::map<int, int> materials_;               // document index to scene index
  std::map<std::pair<int, int>, int> images_;  // likewise; of images and opaque_from
  PixelBudget budget_;
  size_t refused_count_ = 0;
};

}  // namespace voxeld::gltf
