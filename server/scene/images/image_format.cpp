#include "server/scene/images/image_format.h"

#include "server/scene/core/text_cursor.h"

namespace voxeld {
namespace {

struct ImageFormat {
  std::string_view magic;
  size_t magic_at;
  const char* file_name;
};

constexpr ImageFormat kFormats[] = {
    {"\x89PNG\r\n\x1a\n", 0, "image.png"},
    {"\xff\xd8\xff", 0, "image.jpg"},
    {"BM", 0, "image.bmp"},
    {"DDS ", 0, "image.dds"},
    {"WEBP", 8, "image.webp"},
    {"#?", 0, "image.hdr"},
    {std::string_view("II*\0", 4), 0, "image.tif"},
    {std::string_view("MM\0*", 4), 0, "image.tif"},
    {"GIF8", 0, "image.gif"},
};

}  // namespace

const char* image_file_name(std::span<const uint8_t> bytes) {
  const std::string_view text = as_text(bytes);
  for (const ImageFormat& format : kFormats) {
    if (text.size() > format.magic_at && text.substr(format.magic_at).starts_with(format.magic)) {
      return format.file_name;
    }
  }
  return nullptr;
}

}  // namespace voxeld
