// Finds the image that an MD5 mesh's shader means.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "server/scene/core/loaders.h"

namespace voxeld {

// Maps material names to the image of the diffuse stage: "diffusemap image", or a stage "{ blend
// diffusemap map image }". In an image expression such as addnormals( a.tga, heightmap( b.tga, 4 )
// ), the first path counts. Names are compared without regard to case, with slashes for
// backslashes. A truncated file gives what was read so far, as a mesh without its colours is better
// than none.
std::map<std::string, std::string> parse_mtr(std::string_view text);

// Finds images in the upload. It tries its .mtr files, then the shader's name with the extensions
// of images (tga, png, jpg, jpeg, dds, bmp), then with "_d" before the extension, and each by base
// name alone. Case, backslashes and absolute paths make no difference.
class Md5Images {
 public:
  // Both must outlive it. `from` is the mesh file; names are relative to its folder.
  Md5Images(const Bundle& bundle, std::string from);

  // The name of a file of the upload; nullopt if there is none.
  std::optional<std::string> find(std::string_view shader) const;

 private:
  std::optional<std::string> find_image(std::string_view name) const;

  const Bundle& bundle_;
  std::string from_;
  std::map<std::string, std::string> materials_;
};

}  // namespace voxeld
