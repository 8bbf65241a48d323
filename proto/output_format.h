// The formats in which grids and sequences are written. One entry of VOXELD_OUTPUT_FORMATS is all
// that the option `format`, the routes, the CLI, the check of a worker's outputs and the encoders
// know of a format; its own file in server/formats/ defines the two functions that the entry names.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace voxeld {

// X(enumerator, name, media type of a grid, its extension, media type of a sequence, its extension,
//   FileLayout, encoder of a grid, writer of a sequence). Both functions are declared in
//   server/formats/formats.h; a format whose sequences are a zip of its grids names
//   write_zip_sequence.
// clang-format off
#define VOXELD_OUTPUT_FORMATS(X) \
  X(kNative, "native", "application/vnd.voxeld.grid", ".voxg", "application/vnd.voxeld.sequence", \
    ".voxs", FileLayout::tiles(), encode_native, write_native_sequence) \
  X(kNpy, "npy", "application/x-npy", ".npy", "application/x-npy", ".npy", \
    FileLayout::dense_occupancy(), encode_npy, write_npy_sequence) \
  X(kNpz, "npz", "application/x-npz", ".npz", "application/x-npz", ".npz", \
    FileLayout::dense_channels(), encode_npz, write_npz_sequence) \
  X(kVox, "vox", "model/x-magicavoxel-vox", ".vox", "model/x-magicavoxel-vox", ".vox", \
    FileLayout::points(4), encode_vox, write_vox_sequence) \
  X(kXyz, "xyz", "text/x-xyz", ".xyz", "application/zip", ".zip", \
    FileLayout::points(40), encode_xyz, write_zip_sequence)
// clang-format on

#define VOXELD_FORMAT_ENUMERATOR(format, ...) format,
enum class Format { VOXELD_OUTPUT_FORMATS(VOXELD_FORMAT_ENUMERATOR) };  // in the order of the list
#undef VOXELD_FORMAT_ENUMERATOR

// How much a file holds. Checks of size and estimates of memory follow from it.
struct FileLayout {
  enum Kind { kTiles, kPoints, kDenseOccupancy, kDenseChannels };
  Kind kind = kTiles;
  int64_t point_bytes = 0;  // of kPoints: about, for each voxel

  // Compressed tiles, which are written as they are made.
  static constexpr FileLayout tiles() { return {kTiles}; }
  // A record for each voxel.
  static constexpr FileLayout points(int64_t bytes) { return {kPoints, bytes}; }
  // One array with all cells; limits::kDenseCellsMax applies.
  static constexpr FileLayout dense_occupancy() { return {kDenseOccupancy}; }
  // The same for occupancy and for each channel of the grid.
  static constexpr FileLayout dense_channels() { return {kDenseChannels}; }

  constexpr bool is_dense() const { return kind == kDenseOccupancy || kind == kDenseChannels; }
};

struct FormatInfo {
  Format format;
  std::string_view name;                 // "npy"
  std::string_view media_type;           // of a grid: "application/x-npy"
  std::string_view extension;            // ".npy"
  std::string_view sequence_media_type;  // of a sequence's file
  std::string_view sequence_extension;
  FileLayout layout;
};

std::span<const FormatInfo> output_formats();
const FormatInfo& format_info(Format format);

std::string_view format_name(Format format);
std::string_view format_media_type(Format format);
std::string_view format_extension(Format format);     // native: ".voxg"
std::string_view sequence_media_type(Format format);  // native: "application/vnd.voxeld.sequence"
std::string_view sequence_extension(Format format);   // native: ".voxs"
std::optional<Format> format_from_name(std::string_view name);
// The names joined by `separator`: "native | npy".
std::string format_names(std::string_view separator);
// The names of the formats that are not dense, for texts: "native, vox".
std::string sparse_format_names();

}  // namespace voxeld
