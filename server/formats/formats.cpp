#include "server/formats/formats.h"

#include <string>

#include "proto/limits.h"

namespace voxeld {

Status check_encodable(const GridSpec& spec, const OutputOptions& options) {
  const bool dense = format_info(options.format).is_dense;
  if (dense && spec.cell_count() > limits::kDenseCellsMax) {
    return Error{ErrorCode::kGridTooLarge,
                 std::string(format_name(options.format)) +
                     " is dense: too many cells (native and vox are sparse)",
                 "at most " + std::to_string(limits::kDenseCellsMax) + " cells",
                 std::to_string(spec.cell_count())};
  }
  return {};
}

Result<std::vector<uint8_t>> encode(const Grid& grid, const OutputOptions& options) {
  VOXELD_TRY(check_encodable(grid.spec, options));
  switch (options.format) {
    case Format::kNpy:
      return encode_npy(grid, options);
    case Format::kNpz:
      return encode_npz(grid, options);
    case Format::kVox:
      return encode_vox(grid, options);
    case Format::kNative:
      return encode_native(grid, options);
  }
  return Error{ErrorCode::kInternal, "format without an encoder", "", ""};
}

}  // namespace voxeld
