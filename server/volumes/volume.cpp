#include "server/volumes/volume.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "proto/container/grid_format.h"
#include "proto/limits.h"
#include "proto/options/values.h"
#include "server/volumes/header_text.h"
#include "server/volumes/volume_error.h"
#include "server/volumes/volume_files.h"

namespace voxeld {
namespace {

// The number of voxels at most, where a full brick counts as one, because it costs as little. The
// directory tells it, but not how many voxels of a tile are in its full bricks: the others count as
// up to 512. A tile that differs is refused before its attributes are read.
uint64_t counted_voxels(const GridReader& reader) {
  constexpr uint64_t kSide = limits::kBrickSide, kBrickVoxels = kSide * kSide * kSide;
  uint64_t count = 0;
  for (size_t i = 0; i < reader.tile_count(); ++i) {
    const uint64_t voxels = reader.tile_voxel_count(i);
    const uint64_t in_bricks = std::min(voxels, reader.tile_brick_count(i) * kBrickVoxels);
    count += in_bricks + (voxels - in_bricks) / kBrickVoxels;
  }
  return count;
}

// Holds a container to the numbers that other files may have; its own format takes any finite ones.
Status check_place(std::string_view name, const GridHeader& header) {
  using namespace volumes;
  for (size_t c = 0; c < 3; ++c) {
    if (std::abs(header.origin[c]) > kWorldMax) {
      return malformed_volume(name, "origin", "corner of the grid", "3 numbers of at most 1e30",
                              option_values::to_text(header.origin[c]));
    }
    if (header.voxel_size[c] < kVoxelSizeMin || header.voxel_size[c] > kWorldMax) {
      return malformed_volume(name, "voxel size", "edges of a voxel", "numbers from 1e-30 to 1e30",
                              option_values::to_text(header.voxel_size[c]));
    }
  }
  return {};
}

Result<Grid> checked_grid(std::string_view name, std::span<const uint8_t> bytes) {
  VOXELD_ASSIGN(const GridReader reader, GridReader::open(bytes));
  VOXELD_TRY(check_place(name, reader.header()));
  VOXELD_TRY(volumes::check_volume_voxels(name, counted_voxels(reader)));
  return grid_from_container(bytes);
}

Result<Volume> read_container(std::string_view name, std::span<const uint8_t> bytes) {
  auto grid = checked_grid(name, bytes);
  if (!grid) {
    Error& error = grid.error();
    if (error.code != ErrorCode::kBadRequest) return std::move(error);
    return volumes::malformed_volume(name, {}, error.detail, std::move(error.expected),
                                     std::move(error.got));
  }
  Volume volume;
  volume.grid = *std::move(grid);
  return volume;
}

}  // namespace

std::optional<VolumeFormat> detect_volume(std::span<const uint8_t> bytes) {
  using namespace std::string_view_literals;
  constexpr std::pair<std::string_view, VolumeFormat> kFirstBytes[] = {
      {"VOXGRID\0"sv, VolumeFormat::kContainer},
      {"VOX \x96\0\0\0"sv, VolumeFormat::kVox},  // version 150
      {"VOX \xc8\0\0\0"sv, VolumeFormat::kVox},  // version 200
      {"#binvox"sv, VolumeFormat::kBinvox},
      {"\x93NUMPY"sv, VolumeFormat::kNpy},
      {"NRRD000"sv, VolumeFormat::kNrrd}};
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (const auto& [first, format] : kFirstBytes) {
    if (text.starts_with(first)) return format;
  }
  return std::nullopt;
}

std::string_view volume_format_name(VolumeFormat format) {
  switch (format) {
    case VolumeFormat::kContainer:
      return "voxg";
    case VolumeFormat::kVox:
      return "vox";
    case VolumeFormat::kBinvox:
      return "binvox";
    case VolumeFormat::kNpy:
      return "npy";
    case VolumeFormat::kNrrd:
      return "nrrd";
  }
  return "";
}

Result<Volume> load_volume(std::string_view name, std::span<const uint8_t> bytes,
                           double threshold) {
  const auto format = detect_volume(bytes);
  if (!format) {
    return Error{ErrorCode::kUnsupportedMedia, std::string(name) + ": not a file of voxels",
                 "voxg, vox, binvox, npy or nrrd", "other first bytes"};
  }
  switch (*format) {
    case VolumeFormat::kContainer:
      return read_container(name, bytes);
    case VolumeFormat::kVox:
      return volumes::read_vox(name, bytes);
    case VolumeFormat::kBinvox:
      return volumes::read_binvox(name, bytes);
    case VolumeFormat::kNpy:
      return volumes::read_npy(name, bytes, threshold);
    case VolumeFormat::kNrrd:
      return volumes::read_nrrd(name, bytes, threshold);
  }
  return Error{ErrorCode::kInternal, "no such format", "", ""};
}

}  // namespace voxeld
