// Which image an MD5 mesh's shader means.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "server/scene/load.h"

namespace voxeld {

// Material name -> image, of the diffuse stage: "diffusemap image", or a stage "{ blend diffusemap
// map image }". Of an image expression, as in addnormals( a.tga, heightmap( b.tga, 4 ) ), the first
// path counts. Names are compared without regard to case, with slashes for backslashes. A file that
// ends in the middle gives what was read until then: a mesh without its colours is better than
// none.
std::map<std::string, std::string> parse_mtr(std::string_view text);

// Finds images in the upload: by its .mtr files; else the shader's name itself, with the extensions
// of images (tga, png, jpg, jpeg, dds, bmp), the same with "_d" before the extension, and each by
// base name alone. Upper and lower case, backslashes and absolute paths make no difference.
class Md5Images {
 public:
  // Both must outlive it. `from`: the mesh file, relative to whose folder names are looked up.
  Md5Images(const Bundle& bundle, std::string from);

  // The name of a file of the upload; nullopt where there is none.
  std::optional<std::string> find(std::string_view shader) const;

 private:
  std::optional<std::string> find_image(std::string_view name) const;

  std::string from_;
  std::vector<std::string> names_;  // of the upload's files
  std::map<std::string, std::string> materials_;
};

}  // namespace voxeld
