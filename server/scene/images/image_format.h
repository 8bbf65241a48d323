// The formats of images that OpenImageIO reads here.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "proto/result.h"
#include "server/scene/core/scene.h"
#include "server/scene/images/image.h"

namespace voxeld {

// A file name that tells OpenImageIO the reader for these bytes; no such file is opened. Null for
// other bytes. The many other readers that Debian links (ffmpeg, libraw, DICOM, …) never see a
// file, which keeps the attack surface small.
const char* image_file_name(std::span<const uint8_t> bytes);

// The module's function "voxeld_decode_image": as decode_image(), with image_file_name().
using DecodeImage = Result<Image>(std::string_view name, const char* file_name,
                                  std::span<const uint8_t> bytes, PixelBudget* budget);

}  // namespace voxeld
