#include "proto/sequence_format.h"

namespace voxeld {

std::string_view sequence_media_type(Format format) {
  return format == Format::kNative ? "application/vnd.voxeld.sequence" : format_media_type(format);
}

std::string_view sequence_extension(Format format) {
  return format == Format::kNative ? ".voxs" : format_extension(format);
}

}  // namespace voxeld
