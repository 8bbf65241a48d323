#include "server/formats/formats.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <iterator>
#include <string>
#include <system_error>
#include <utility>

#include "proto/limits.h"
#include "proto/minecraft_blocks.h"
#include "proto/options/values.h"
#include "server/base/disk/file.h"
#include "server/formats/images/slices.h"
#include "server/formats/lost_data.h"
#include "server/formats/mesh/mesh_warnings.h"
#include "server/formats/minecraft/block_file.h"
#include "server/formats/octomap.h"
#include "server/formats/output_file.h"
#include "server/formats/points/ldr.h"
#include "server/formats/volume/binvox.h"
#include "server/formats/vox_parts.h"
#include "server/formats/zip/zip_writer.h"
#include "server/grid/region.h"

namespace voxeld {
namespace {

constexpr size_t kVoxFramesShown = 120;  // frames that MagicaVoxel's editor plays

struct FormatFunctions {
  Status (*encode)(const Grid&, const OutputOptions&, OutputFile&);
  Status (*write)(const FrameSource&, const OutputOptions&, const std::filesystem::path&);
};

#define VOXELD_FORMAT_PAIR(format, name, type, extension, sequence_type, sequence_extension, \
                           density, encode, write)                                           \
  FormatFunctions{encode, write},
constexpr std::array kFunctions = {VOXELD_OUTPUT_FORMATS(VOXELD_FORMAT_PAIR)};
#undef VOXELD_FORMAT_PAIR

const FormatFunctions& functions_of(Format format) {
  return kFunctions.at(static_cast<size_t>(format));
}

// A file that is removed with this object.
struct ScratchFile {
  explicit ScratchFile(std::filesystem::path of) : path(std::move(of)) {}
  ~ScratchFile() {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
  }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  const std::filesystem::path path;
};

void append(std::vector<Warning>& warnings, std::vector<Warning> more) {
  std::ranges::move(more, std::back_inserter(warnings));
}

Error too_dense(Format format, const std::string& what, int64_t cells_max, uint64_t cells) {
  const std::string sparse = format_info(format).layout.may_be_sparse
                                 ? "layout=sparse is not"
                                 : "npy and npz with layout=sparse are not";
  return {ErrorCode::kGridTooLarge,
          std::string(format_name(format)) + " is dense: " + what + " (" + sparse +
              ", nor are formats " + sparse_format_names() + ")",
          "at most " + std::to_string(cells_max) + " cells", std::to_string(cells)};
}

}  // namespace

Status check_encodable(const GridSpec& spec, const OutputOptions& options) {
  if (holds_blocks(options.format)) return minecraft::check_cells(spec, options.format);
  if (options.file_layout().is_dense() && spec.cell_count() > limits::kDenseCellsMax) {
    return too_dense(options.format, "too many cells", limits::kDenseCellsMax,
                     static_cast<uint64_t>(spec.cell_count()));
  }
  if (options.layout == ArrayLayout::kAtlas) return images::check_atlas(spec);
  return options.format == Format::kBinvox ? volume::check_binvox(spec) : Status();
}

Status check_channels(const ChannelSet& channels, const OutputOptions& options) {
  if (options.dilate > 0 && channels.distance) {
    return Error{ErrorCode::kInvalidOption, "dilate: distances of added voxels are not known",
                 "a grid without channel distance", "distance"};
  }
  const bool has_channel = !options.channel || channels.has(*options.channel);
  const bool may_remap = options.remap.empty() || channels.label;
  if (has_channel && may_remap && (channels.color || !recolors(options))) return {};
  std::string known = "occupancy";
  for (const ChannelInfo& info : kChannels) {
    if (channels.has(info.channel)) known += " | " + std::string(info.name);
  }
  if (!may_remap) {
    return Error{ErrorCode::kInvalidOption, "remap: the grid has no labels", "channel label",
                 known};
  }
  if (has_channel) {
    return Error{ErrorCode::kInvalidOption, "palette: the grid has no colours", "channel color",
                 known};
  }
  return option_values::invalid("channel", known + ", which the grid has",
                                channel_info(*options.channel).name);
}

bool is_written_in_pieces(Format format) {
  constexpr std::array kInPieces = {Format::kCsv, Format::kPcd, Format::kVdb, Format::kNvdb,
                                    Format::kBt,  Format::kLdr, Format::kVtu, Format::kInp};
  return std::ranges::count(kInPieces, format) > 0;
}

Status write_grid(const Grid& grid, const OutputOptions& options,
                  const std::filesystem::path& path) {
  VOXELD_TRY(check_encodable(grid.spec, options));
  VOXELD_TRY(check_channels(grid.channels, options));
  VOXELD_ASSIGN(OutputFile file, OutputFile::create(path));
  return functions_of(options.format).encode(grid, options, file);
}

Result<std::vector<uint8_t>> encode(const Grid& grid, const OutputOptions& options) {
  VOXELD_TRY(check_encodable(grid.spec, options));
  VOXELD_TRY(check_channels(grid.channels, options));
  OutputFile file = OutputFile::in_memory();
  VOXELD_TRY(functions_of(options.format).encode(grid, options, file));
  return file.take_bytes();
}

Status check_sequence_encodable(const GridSpec& spec, size_t frames, const OutputOptions& options) {
  VOXELD_TRY(check_encodable(spec, options));
  if (!options.file_layout().is_dense()) return {};
  const auto side = static_cast<uint64_t>(std::max({spec.dims.x, spec.dims.y, spec.dims.z}));
  const uint64_t of_frame = options.format == Format::kBinvox
                                ? side * side * side
                                : static_cast<uint64_t>(spec.cell_count());
  const uint64_t cells = of_frame * frames;  // at most 2^31 times 2^32
  if (cells <= static_cast<uint64_t>(limits::kSequenceDenseCellsMax)) return {};
  return too_dense(options.format, "too many cells in all frames", limits::kSequenceDenseCellsMax,
                   cells);
}

std::vector<Warning> encode_warnings(const Grid& grid, const OutputOptions& options) {
  if (holds_blocks(options.format)) return minecraft::block_warnings(grid, options.format);
  if (options.file_layout().is_mesh()) return mesh::mesh_warnings(grid, options);
  std::vector<Warning> warnings = lost_data_warnings(grid, options);
  if (options.format == Format::kVox) append(warnings, vox::scene_warnings(grid.spec));
  if (options.format == Format::kBt) append(warnings, octomap::lattice_warnings(grid.spec));
  if (options.format == Format::kLdr) append(warnings, ldraw::brick_warnings(grid.spec));
  return warnings;
}

std::vector<Warning> sequence_warnings(const Grid& common, size_t frames,
                                       const OutputOptions& options) {
  std::vector<Warning> warnings = encode_warnings(common, options);
  if (options.format == Format::kVox && frames > kVoxFramesShown) {
    warnings.push_back({"many-frames", "vox: MagicaVoxel plays " + std::to_string(kVoxFramesShown) +
                                           " frames of " + std::to_string(frames)});
  }
  return warnings;
}

Status write_sequence(const FrameSource& source, const OutputOptions& options,
                      const std::filesystem::path& path) {
  VOXELD_TRY(check_sequence_encodable(source.common().spec, source.frame_count(), options));
  return functions_of(options.format).write(source, options, path);
}

Status write_zip_sequence(const FrameSource& source, const OutputOptions& options,
                          const std::filesystem::path& path) {
  VOXELD_ASSIGN(OutputFile file, OutputFile::create(path));
  ZipWriter zip(file);
  const ScratchFile frame_file(path.string() + ".frame");
  for (size_t i = 0; i < source.frame_count(); ++i) {
    {
      VOXELD_ASSIGN(const Grid frame, source.frame(i));
      VOXELD_TRY(write_grid(frame, options, frame_file.path));
    }
    VOXELD_ASSIGN(const MappedFile bytes, MappedFile::open(frame_file.path));
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "frame-%04zu", i);
    VOXELD_TRY(zip.begin(name.data() + std::string(format_extension(options.format))));
    VOXELD_TRY(zip.add(bytes.bytes()));
  }
  return zip.finish();
}

}  // namespace voxeld
