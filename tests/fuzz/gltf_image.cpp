// Textures of all formats. The seeds have one small file of each.
#include <cstddef>
#include <cstdint>

#include "server/base/check.h"
#include "server/scene/images/image.h"
#include "server/scene/images/tga.h"

namespace {

void check(const voxeld::Result<voxeld::Image>& image) {
  if (!image) {
    VOXELD_CHECK(!image.error().detail.empty(), "an error says what");
    return;
  }
  VOXELD_CHECK(image->width > 0 && image->height > 0, "no empty image");
  VOXELD_CHECK(image->rgba.size() == 4 * static_cast<size_t>(image->width) * image->height,
               "four bytes per pixel");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  check(voxeld::decode_tga("fuzz.tga", {data, size}));
  check(voxeld::decode_image("fuzz", {data, size}));
  return 0;
}
