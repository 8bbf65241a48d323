// write_gif() in a build without OpenImageIO.
#include "server/render/animated_image.h"

namespace voxeld {

Result<std::unique_ptr<AnimationWriter>> write_gif(const std::filesystem::path&,
                                                   const std::vector<double>&) {
  return Error{ErrorCode::kUnsupportedFeature, "this voxeld was built without OpenImageIO",
               "a build that writes GIF", "VOXELD_WITH_IMAGES=OFF"};
}

}  // namespace voxeld
