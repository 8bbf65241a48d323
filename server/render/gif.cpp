// write_gif() by the module for images (base/image_module.h).
#include "server/process/image_module.h"
#include "server/render/animated_image.h"

namespace voxeld {

Result<std::unique_ptr<AnimationWriter>> write_gif(const std::filesystem::path& path,
                                                   const std::vector<double>& durations_s) {
  VOXELD_ASSIGN(const auto write, image_module_function<decltype(write_gif)>("voxeld_write_gif"));
  return (*write)(path, durations_s);
}

}  // namespace voxeld
