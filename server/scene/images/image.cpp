// decode_image(): TGA here, other formats by the module for images (base/image_module.h).
#include "server/scene/images/image.h"

#include <string>

#include "server/process/image_module.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/images/image_format.h"
#include "server/scene/images/tga.h"

namespace voxeld {

Result<Image> decode_image(std::string_view name, std::span<const uint8_t> bytes,
                           PixelBudget* budget) {
  if (const char* file_name = image_file_name(bytes)) {
    VOXELD_ASSIGN(const auto decode, image_module_function<DecodeImage>("voxeld_decode_image"));
    return (*decode)(name, file_name, bytes, budget);
  }
  if (looks_like_tga(bytes)) return decode_tga(name, bytes, budget);
  return Error{ErrorCode::kUnsupportedMedia, std::string(name) + ": not an image that voxeld reads",
               "PNG, JPEG, TGA, BMP, DDS, WebP, HDR, TIFF or GIF",
               shown(as_text(bytes).substr(0, 8))};
}

}  // namespace voxeld
