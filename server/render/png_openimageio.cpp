// encode_png() by OpenImageIO, for the module (base/image_module.h).
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <exception>

#include "server/base/check.h"
#include "server/process/image_module.h"
#include "server/render/render.h"

namespace voxeld {
namespace {

Error png_error(std::string what) {
  return Error{ErrorCode::kInternal, "encoding PNG: " + std::move(what), "", ""};
}

Result<std::vector<uint8_t>> encode(const RenderImage& image) {
  VOXELD_CHECK(image.rgba.size() == size_t{4} * image.width * image.height, "4 bytes per pixel");
  try {
    std::vector<uint8_t> bytes;
    OIIO::Filesystem::IOVecOutput proxy(bytes);
    const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create("image.png");
    if (output == nullptr) return png_error(OIIO::geterror());
    OIIO::ImageSpec spec(image.width, image.height, 4, OIIO::TypeDesc::UINT8);
    spec.attribute("oiio:ColorSpace", "sRGB");
    // PNG stores straight alpha. Without this OpenImageIO divides by alpha once more.
    spec.attribute("oiio:UnassociatedAlpha", 1);
    // Level 4 takes half the time of the default 6, for 3% more bytes on images of voxels.
    spec.attribute("png:compressionLevel", 4);
    if (!output->set_ioproxy(&proxy)) return png_error("OpenImageIO writes PNG to files alone");
    if (!output->open("image.png", spec) ||
        !output->write_image(OIIO::TypeDesc::UINT8, image.rgba.data()) || !output->close()) {
      return png_error(output->geterror());
    }
    return bytes;
  } catch (const std::exception& error) {
    return png_error(error.what());
  }
}

}  // namespace
}  // namespace voxeld

VOXELD_PUBLISH(voxeld_encode_png, voxeld::encode)
