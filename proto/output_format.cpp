#include "proto/output_format.h"

#include <algorithm>
#include <array>

namespace voxeld {
namespace {

constexpr std::array kFormats = {
    FormatInfo{Format::kNative, "native", "application/vnd.voxeld.grid", ".voxg",
               "application/vnd.voxeld.sequence", ".voxs", false},
    FormatInfo{Format::kNpy, "npy", "application/x-npy", ".npy", "application/x-npy", ".npy", true},
    FormatInfo{Format::kNpz, "npz", "application/x-npz", ".npz", "application/x-npz", ".npz", true},
    FormatInfo{Format::kVox, "vox", "model/x-magicavoxel-vox", ".vox", "model/x-magicavoxel-vox",
               ".vox", false},
};

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

std::string format_names(std::string_view separator) {
  std::string names;
  for (const FormatInfo& info : kFormats) {
    names += (names.empty() ? "" : std::string(separator)) + std::string(info.name);
  }
  return names;
}

}  // namespace voxeld
