// The formats in which grids and sequences are written. One entry of VOXELD_OUTPUT_FORMATS is all
// that the option `format`, the routes, the CLI, the check of a worker's outputs and the encoders
// know of a format; its own file in server/formats/ defines the two functions that the entry names.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace voxeld {

// X(enumerator, name, media type of a grid, its extension, media type of a sequence, its extension,
//   kDense (writes every cell: limits::kDenseCellsMax applies) or kSparse, encoder of a grid,
//   writer of a sequence). Both functions are declared in server/formats/formats.h; a format whose
// sequences are a zip of its grids names write_zip_sequence.
// clang-format off
#define VOXELD_OUTPUT_FORMATS(X) \
  X(kNative, "native", "application/vnd.voxeld.grid", ".voxg", "application/vnd.voxeld.sequence", \
    ".voxs", kSparse, encode_native, write_native_sequence) \
  X(kNpy, "npy", "application/x-npy", ".npy", "application/x-npy", ".npy", kDense, encode_npy, \
    write_npy_sequence) \
  X(kNpz, "npz", "application/x-npz", ".npz", "application/x-npz", ".npz", kDense, encode_npz, \
    write_npz_sequence) \
  X(kVox, "vox", "model/x-magicavoxel-vox", ".vox", "model/x-magicavoxel-vox", ".vox", kSparse, \
    encode_vox, write_vox_sequence) \
  X(kXyz, "xyz", "text/x-xyz", ".xyz", "application/zip", ".zip", kSparse, encode_xyz, \
    write_zip_sequence)
// clang-format on

#define VOXELD_FORMAT_ENUMERATOR(format, ...) format,
enum class Format { VOXELD_OUTPUT_FORMATS(VOXELD_FORMAT_ENUMERATOR) };  // in the order of the list
#undef VOXELD_FORMAT_ENUMERATOR

struct FormatInfo {
  Format format;
  std::string_view name;                 // "npy"
  std::string_view media_type;           // of a grid: "application/x-npy"
  std::string_view extension;            // ".npy"
  std::string_view sequence_media_type;  // of a sequence's file
  std::string_view sequence_extension;
  bool is_dense;
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
// The names of the formats that are not dense, for texts: "native, vox".
std::string sparse_format_names();

}  // namespace voxeld
