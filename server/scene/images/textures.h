// Loads the textures that a mesh file names from its bundle into its scene.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>

#include "server/scene/core/loaders.h"
#include "server/scene/core/scene.h"
#include "server/scene/images/image.h"

namespace voxeld {

// The only image of a bundle, for a mesh that names no texture (spot.zip is one). nullopt for none
// and for several.
std::optional<std::string> only_image(const Bundle& bundle);

// Drops vertex colours of parts that have a texture, with the warning "ignored-colors". For formats
// that do not say how both go together: scanners write the same colours twice, and viewers show the
// texture alone.
void prefer_textures(Scene& scene, std::string_view name);

// Decodes each texture once. One per load; not thread-safe; scene and bundle must outlive it.
class TextureSet {
 public:
  // `from`: the file; references are relative to its folder.
  TextureSet(Scene& scene, const Bundle& bundle, std::string from, const LoadOptions& options)
      : scene_(scene), bundle_(bundle), from_(std::move(from)), options_(options) {}

  // Index into scene.images. A missing or broken image gives -1, a warning ("missing-texture",
  // "broken-texture") and an entry of missing_files. `needed_by` names the material or file.
  int image_index(std::string_view reference, std::string_view needed_by);
  // Index of a copy of `image` (-1: white) that has the opacity which another one tells by a
  // channel: r, g, b, m (its alpha) or l (luminance); 0: m, or l if all of it is opaque. It is as
  // large as the larger one on each axis. needed_by as above.
  int with_opacity(int image, int opacity, char channel, std::string_view needed_by);

 private:
  int load(const std::string& reference, std::string_view needed_by);
  int too_many(const std::string& reference, std::string_view needed_by);

  Scene& scene_;
  const Bundle& bundle_;
  std::string from_;
  LoadOptions options_;
  PixelBudget budget_;
  std::map<std::string, int, std::less<>> loaded_;
  std::map<std::tuple<int, int, char>, int> with_opacity_;
};

}  // namespace voxeld
