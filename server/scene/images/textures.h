// Loads the textures that a mesh file names from its bundle into its scene.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "server/scene/core/loaders.h"
#include "server/scene/core/scene.h"
#include "server/scene/images/image.h"

namespace voxeld {

// The only image of a bundle, for a mesh that names no texture (spot.zip is one). nullopt for none
// and for several.
std::optional<std::string> only_image(const Bundle& bundle);

// Decodes each texture once. One per load; not thread-safe; scene and bundle must outlive it.
class TextureSet {
 public:
  // `from`: the file; references are relative to its folder.
  TextureSet(Scene& scene, const Bundle& bundle, std::string from, const LoadOptions& options)
      : scene_(scene), bundle_(bundle), from_(std::move(from)), options_(options) {}

  // Index into scene.images. A missing or broken image gives -1, a warning ("missing-texture",
  // "broken-texture") and an entry of missing_files. `needed_by` names the material or file.
  int image_index(std::string_view reference, std::string_view needed_by);

 private:
  int load(const std::string& reference, std::string_view needed_by);
  int too_many(const std::string& reference, std::string_view needed_by);

  Scene& scene_;
  const Bundle& bundle_;
  std::string from_;
  LoadOptions options_;
  PixelBudget budget_;
  std::map<std::string, int, std::less<>> loaded_;
};

}  // namespace voxeld
