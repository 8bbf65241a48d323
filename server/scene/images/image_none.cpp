// The image decoder of builds without OpenImageIO: sanitizers and fuzzers.
#include <string>

#include "server/scene/images/image.h"

namespace voxeld {

Result<Image> decode_image(std::string_view name, std::span<const uint8_t>, PixelBudget*) {
  return Error{ErrorCode::kUnsupportedFeature,
               std::string(name) + ": this build of voxeld reads no images", "", ""};
}

}  // namespace voxeld
