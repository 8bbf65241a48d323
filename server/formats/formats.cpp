#include "server/formats/formats.h"

#include <array>
#include <cstdio>
#include <string>

#include "proto/limits.h"
#include "server/formats/sequence_file.h"
#include "server/formats/zip_writer.h"

namespace voxeld {
namespace {

constexpr size_t kVoxFramesShown = 120;  // frames that MagicaVoxel's editor plays

struct FormatFunctions {
  Result<std::vector<uint8_t>> (*encode)(const Grid&, const OutputOptions&);
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

}  // namespace

Status check_encodable(const GridSpec& spec, const OutputOptions& options) {
  const FormatInfo& format = format_info(options.format);
  if (format.layout.is_dense() && spec.cell_count() > limits::kDenseCellsMax) {
    return Error{ErrorCode::kGridTooLarge,
                 std::string(format.name) +
                     " is dense: too many cells (sparse formats: " + sparse_format_names() + ")",
                 "at most " + std::to_string(limits::kDenseCellsMax) + " cells",
                 std::to_string(spec.cell_count())};
  }
  return {};
}

Result<std::vector<uint8_t>> encode(const Grid& grid, const OutputOptions& options) {
  VOXELD_TRY(check_encodable(grid.spec, options));
  return functions_of(options.format).encode(grid, options);
}

Status check_sequence_encodable(const GridSpec& spec, size_t frames, const OutputOptions& options) {
  VOXELD_TRY(check_encodable(spec, options));
  const FormatInfo& format = format_info(options.format);
  const auto cells = static_cast<uint64_t>(spec.cell_count()) * frames;  // at most 2^31 times 2^32
  if (!format.layout.is_dense() || cells <= static_cast<uint64_t>(limits::kSequenceDenseCellsMax))
    return {};
  return Error{
      ErrorCode::kGridTooLarge,
      std::string(format.name) +
          " is dense: too many cells in all frames (sparse formats: " + sparse_format_names() + ")",
      "at most " + std::to_string(limits::kSequenceDenseCellsMax) + " cells",
      std::to_string(cells)};
}

std::vector<Warning> sequence_warnings(const GridSpec& spec, size_t frames,
                                       const OutputOptions& options) {
  std::vector<Warning> warnings = encode_warnings(spec, options);
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
  VOXELD_ASSIGN(SequenceFile file, SequenceFile::create(path));
  ZipWriter zip(file);
  for (size_t i = 0; i < source.frame_count(); ++i) {
    VOXELD_ASSIGN(const Grid frame, source.frame(i));
    VOXELD_ASSIGN(const std::vector<uint8_t> bytes, encode(frame, options));
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "frame-%04zu", i);
    VOXELD_TRY(zip.begin(name.data() + std::string(format_extension(options.format))));
    VOXELD_TRY(zip.add(bytes));
  }
  return zip.finish();
}

}  // namespace voxeld
