// encode_png() in a build without OpenImageIO.
#include "server/render/render.h"

namespace voxeld {

Result<std::vector<uint8_t>> encode_png(const RenderImage&) {
  return Error{ErrorCode::kUnsupportedFeature, "this voxeld was built without OpenImageIO",
               "a build that writes PNG", "VOXELD_WITH_IMAGES=OFF"};
}

}  // namespace voxeld
