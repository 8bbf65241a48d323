// The formats in which grids and sequences are written. One table names them for the option
// `format`, the routes, the CLI and the check of a worker's outputs.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace voxeld {

enum class Format { kNative, kNpy, kNpz, kVox };  // in the order of the table

struct FormatInfo {
  Format format;
  std::string_view name;                 // "npy"
  std::string_view media_type;           // of a grid: "application/x-npy"
  std::string_view extension;            // ".npy"
  std::string_view sequence_media_type;  // of a sequence's file
  std::string_view sequence_extension;
  bool is_dense;  // writes every cell, so that limits::kDenseCellsMax applies
};

std::span<const FormatInfo> output_formats();
const FormatInfo& format_info(Format format);

std::string_view format_name(Format format);
std::string_view format_media_type(Format format);
std::string_view format_extension(Format format);     // native: ".voxg"
std::string_view sequence_media_type(Format format);  // native: "application/vnd.voxeld.sequence"
std::string_view sequence_extension(Format format);   // native: ".voxs"
std::optional<Format> format_from_name(std::string_view name);
// The names joined by `separator`: "native | npy | npz | vox".
std::string format_names(std::string_view separator);

}  // namespace voxeld
