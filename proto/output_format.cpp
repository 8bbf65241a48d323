#include "proto/output_format.h"

#include <algorithm>
#include <array>

namespace voxeld {
namespace {

#define VOXELD_FORMAT_INFO(format, name, type, extension, sequence_type, sequence_extension, \
                           layout, ...)                                                      \
  FormatInfo{Format::format, name, type, extension, sequence_type, sequence_extension, layout},
constexpr std::array kFormats = {VOXELD_OUTPUT_FORMATS(VOXELD_FORMAT_INFO)};
#undef VOXELD_FORMAT_INFO

}  // namespace

std::span<const FormatInfo> output_formats() {
  return kFormats;
}

const FormatInfo& format_info(Format format) {
  return kFormats.at(static_cast<size_t>(format));
}

std::string_view format_name(Format format) {
  return format_info(format).name;
}

std::string_view format_media_type(Format format) {
  return format_info(format).media_type;
}

std::string_view format_extension(Format format) {
  return format_info(format).extension;
}

std::string_view sequence_media_type(Format format) {
  return format_info(format).sequence_media_type;
}

std::string_view sequence_extension(Format format) {
  return format_info(format).sequence_extension;
}

std::optional<Format> format_from_name(std::string_view name) {
  const auto found = std::ranges::find(kFormats, name, &FormatInfo::name);
  if (found == kFormats.end()) return std::nullopt;
  return found->format;
}

std::string sparse_format_names() {
  std::string names;
  for (const FormatInfo& info : kFormats) {
    if (!info.layout.is_dense()) names += (names.empty() ? "" : ", ") + std::string(info.name);
  }
  return names;
}

std::string format_names(std::string_view separator) {
  std::string names;
  for (const FormatInfo& info : kFormats) {
    names += (names.empty() ? "" : std::string(separator)) + std::string(info.name);
  }
  return names;
}

}  // namespace voxeld
