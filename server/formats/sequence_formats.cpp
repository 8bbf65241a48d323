#include "server/formats/sequence_formats.h"

#include <string>

#include "proto/limits.h"
#include "server/formats/formats.h"

namespace voxeld {
namespace {

constexpr size_t kVoxFramesShown = 120;  // frames that MagicaVoxel's editor plays

}  // namespace

Status check_sequence_encodable(const GridSpec& spec, size_t frames, const OutputOptions& options) {
  VOXELD_TRY(check_encodable(spec, options));
  const bool dense = format_info(options.format).is_dense;
  const auto cells = static_cast<uint64_t>(spec.cell_count()) * frames;  // at most 2^31 times 2^32
  if (!dense || cells <= static_cast<uint64_t>(limits::kSequenceDenseCellsMax)) return {};
  return Error{ErrorCode::kGridTooLarge,
               std::string(format_name(options.format)) +
                   " is dense: too many cells in all frames (native and vox are sparse)",
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
  switch (options.format) {
    case Format::kNpy:
      return write_npy_sequence(source, options, path);
    case Format::kNpz:
      return write_npz_sequence(source, options, path);
    case Format::kVox:
      return write_vox_sequence(source, options, path);
    case Format::kNative:
      return write_native_sequence(source, options, path);
  }
  return Error{ErrorCode::kInternal, "format without an encoder", "", ""};
}

}  // namespace voxeld
