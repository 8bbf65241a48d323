// encode_png() by the module for images (base/image_module.h).
#include "server/process/image_module.h"
#include "server/render/render.h"

namespace voxeld {

Result<std::vector<uint8_t>> encode_png(const RenderImage& image) {
  VOXELD_ASSIGN(const auto encode,
                image_module_function<decltype(encode_png)>("voxeld_encode_png"));
  return (*encode)(image);
}

}  // namespace voxeld
