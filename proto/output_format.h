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
    FileLayout::dense_occupancy().or_sparse(), encode_npy, write_npy_sequence) \
  X(kNpz, "npz", "application/x-npz", ".npz", "application/x-npz", ".npz", \
    FileLayout::dense_channels().or_sparse(), encode_npz, write_npz_sequence) \
  X(kVox, "vox", "model/x-magicavoxel-vox", ".vox", "model/x-magicavoxel-vox", ".vox", \
    FileLayout::points(4), encode_vox, write_vox_sequence) \
  X(kXyz, "xyz", "text/x-xyz", ".xyz", "application/zip", ".zip", \
    FileLayout::points(40), encode_xyz, write_zip_sequence) \
  X(kGlb, "glb", "model/gltf-binary", ".glb", "application/zip", ".zip", \
    FileLayout::surface(), encode_glb, write_zip_sequence) \
  X(kPly, "ply", "model/ply", ".ply", "application/zip", ".zip", \
    FileLayout::surface(), encode_ply, write_zip_sequence) \
  X(kObj, "obj", "model/obj", ".obj", "application/zip", ".zip", \
    FileLayout::surface(), encode_obj, write_zip_sequence) \
  X(kVti, "vti", "application/x-vti", ".vti", "application/zip", ".zip", \
    FileLayout::dense_channels(), encode_vti, write_zip_sequence) \
  X(kNrrd, "nrrd", "application/x-nrrd", ".nrrd", "application/zip", ".zip", \
    FileLayout::dense_channel(), encode_nrrd, write_zip_sequence) \
  X(kMha, "mha", "application/x-metaimage", ".mha", "application/zip", ".zip", \
    FileLayout::dense_channel(), encode_mha, write_zip_sequence) \
  X(kNii, "nii", "application/x-nifti", ".nii.gz", "application/zip", ".zip", \
    FileLayout::dense_channel(), encode_nii, write_zip_sequence) \
  X(kBinvox, "binvox", "application/x-binvox", ".binvox", "application/zip", ".zip", \
    FileLayout::dense_occupancy(), encode_binvox, write_zip_sequence) \
  X(kCsv, "csv", "text/csv", ".csv", "application/zip", ".zip", \
    FileLayout::points(60), encode_csv, write_zip_sequence) \
  X(kPcd, "pcd", "application/x-pcd", ".pcd", "application/zip", ".zip", \
    FileLayout::points(28), encode_pcd, write_zip_sequence) \
  X(kQb, "qb", "model/x-qubicle-qb", ".qb", "application/zip", ".zip", \
    FileLayout::points(12), encode_qb, write_zip_sequence) \
  X(kSchem, "schem", "application/x-schem", ".schem", "application/zip", ".zip", \
    FileLayout::dense_occupancy(), encode_schem, write_zip_sequence) \
  X(kLitematic, "litematic", "application/x-litematic", ".litematic", "application/zip", ".zip", \
    FileLayout::dense_occupancy(), encode_litematic, write_zip_sequence) \
  X(kNbt, "nbt", "application/x-nbt", ".nbt", "application/zip", ".zip", \
    FileLayout::points(40), encode_nbt, write_zip_sequence) \
  X(kZarr, "zarr", "application/x-zarr+zip", ".zarr.zip", "application/x-zarr+zip", ".zarr.zip", \
    FileLayout::tiles(), encode_zarr, write_zarr_sequence) \
  X(kVdb, "vdb", "application/x-vdb", ".vdb", "application/zip", ".zip", \
    FileLayout::points(16), encode_vdb, write_zip_sequence) \
  X(kNvdb, "nvdb", "application/x-nvdb", ".nvdb", "application/zip", ".zip", \
    FileLayout::points(16), encode_nvdb, write_zip_sequence) \
  X(kBt, "bt", "application/x-octomap-bt", ".bt", "application/zip", ".zip", \
    FileLayout::points(4), encode_bt, write_zip_sequence) \
  X(kLdr, "ldr", "application/x-ldraw", ".ldr", "application/zip", ".zip", \
    FileLayout::points(50), encode_ldr, write_zip_sequence) \
  X(kVtu, "vtu", "application/x-vtu", ".vtu", "application/zip", ".zip", \
    FileLayout::points(100), encode_vtu, write_zip_sequence) \
  X(kInp, "inp", "application/x-abaqus-inp", ".inp", "application/zip", ".zip", \
    FileLayout::points(150), encode_inp, write_zip_sequence) \
  X(kKtx2, "ktx2", "image/ktx2", ".ktx2", "application/zip", ".zip", \
    FileLayout::dense_channel(), encode_ktx2, write_zip_sequence) \
  X(kRaw, "raw", "application/x-raw+zip", ".raw.zip", "application/zip", ".zip", \
    FileLayout::dense_channel(), encode_raw, write_zip_sequence) \
  X(kSlices, "slices", "application/x-png-slices+zip", ".slices.zip", "application/zip", ".zip", \
    FileLayout::dense_channel(), encode_slices, write_zip_sequence)
// clang-format on

#define VOXELD_FORMAT_ENUMERATOR(format, ...) format,
enum class Format { VOXELD_OUTPUT_FORMATS(VOXELD_FORMAT_ENUMERATOR) };  // in the order of the list
#undef VOXELD_FORMAT_ENUMERATOR

// How much a file holds. Checks of size and estimates of memory follow from it.
struct FileLayout {
  enum Kind {
    kTiles,
    kPoints,
    kSurface,
    kSparseArrays,
    kDenseOccupancy,
    kDenseChannel,
    kDenseChannels
  };
  Kind kind = kTiles;
  int64_t point_bytes = 0;     // of kPoints: about, for each voxel
  bool may_be_sparse = false;  // of dense kinds: layout=sparse writes sparse_arrays() instead

  // Compressed tiles, which are written as they are made.
  static constexpr FileLayout tiles() { return {kTiles}; }
  // A record for each voxel.
  static constexpr FileLayout points(int64_t bytes) { return {kPoints, bytes}; }
  // A mesh of the voxels' outer faces.
  static constexpr FileLayout surface() { return {kSurface}; }
  // Arrays with a row for each voxel, which are written as they are made;
  // limits::kSparseVoxelsMax applies.
  static constexpr FileLayout sparse_arrays() { return {kSparseArrays}; }
  // One array with all cells; limits::kDenseCellsMax applies.
  static constexpr FileLayout dense_occupancy() { return {kDenseOccupancy}; }
  // The same for occupancy or one channel of the grid, which the option `channel` names.
  static constexpr FileLayout dense_channel() { return {kDenseChannel}; }
  // The same for occupancy and for each channel of the grid.
  static constexpr FileLayout dense_channels() { return {kDenseChannels}; }
  constexpr FileLayout or_sparse() const { return {kind, point_bytes, true}; }

  constexpr bool is_mesh() const { return kind == kSurface; }
  constexpr bool is_dense() const { return kind >= kDenseOccupancy; }
};

struct FormatInfo {
  Format format;
  std::string_view name;                 // "npy"
  std::string_view media_type;           // of a grid: "application/x-npy"
  std::string_view extension;            // ".npy"
  std::string_view sequence_media_type;  // of a sequence's file
  std::string_view sequence_extension;
  FileLayout layout;  // of dense formats: unless the request asks for sparse arrays
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
