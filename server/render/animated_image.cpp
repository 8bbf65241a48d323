// The parts that all animated formats share, and contact sheets.
#include "server/render/animated_image.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "proto/limits.h"
#include "server/base/check.h"
#include "server/base/pieces.h"

namespace voxeld {
namespace {

constexpr uint32_t kDurationMax = 65'535;  // both formats store 16 bits

}  // namespace

std::vector<uint32_t> whole_durations(const std::vector<double>& durations_s, double parts_per_s,
                                      uint32_t least) {
  std::vector<uint32_t> whole;
  // Times in parts. Rounding the running end, not each duration, keeps the total length right.
  double end = 0.0, shown = 0.0;
  for (const double duration_s : durations_s) {
    end += std::max(duration_s, 0.0) * parts_per_s;
    const double wanted = std::floor(end - shown + 0.5);
    const double taken =
        std::clamp(wanted, static_cast<double>(least), static_cast<double>(kDurationMax));
    whole.push_back(static_cast<uint32_t>(taken));
    shown += taken;
  }
  return whole;
}

Result<SheetLayout> sheet_layout(size_t count, int columns, int width, int height) {
  const auto images = static_cast<int>(std::max<size_t>(count, 1));
  SheetLayout layout{columns, 1, width, height};
  if (columns <= 0) {
    layout.columns = static_cast<int>(std::ceil(std::sqrt(static_cast<double>(images))));
  }
  layout.columns = std::min(layout.columns, images);
  layout.rows = (images + layout.columns - 1) / layout.columns;
  const int64_t across = int64_t{layout.columns} * width, down = int64_t{layout.rows} * height;
  if (std::max(across, down) <= limits::kSheetSideMax) return layout;
  return Error{ErrorCode::kInvalidOption, "image: the sheet is too large",
               "at most " + std::to_string(limits::kSheetSideMax) +
                   " pixels to a side, by fewer or smaller images",
               std::to_string(images) + " images of " + std::to_string(width) + " x " +
                   std::to_string(height) + " pixels in " + std::to_string(layout.columns) +
                   " columns: " + std::to_string(across) + " x " + std::to_string(down)};
}

RenderImage begin_sheet(const SheetLayout& layout, const std::array<uint8_t, 4>& background) {
  RenderImage sheet{layout.columns * layout.width, layout.rows * layout.height, {}};
  const size_t pixels = static_cast<size_t>(sheet.width) * static_cast<size_t>(sheet.height);
  sheet.rgba.reserve(4 * pixels);
  for (size_t i = 0; i < pixels; ++i) {
    cancel_point_at(i);
    sheet.rgba.insert(sheet.rgba.end(), background.begin(), background.end());
  }
  return sheet;
}

void place_in_sheet(const SheetLayout& layout, size_t index, const RenderImage& image,
                    RenderImage& sheet) {
  VOXELD_CHECK(image.width == layout.width && image.height == layout.height,
               "images of a sheet have its size");
  const auto columns = static_cast<size_t>(layout.columns);
  const size_t left = index % columns * static_cast<size_t>(layout.width);
  const size_t top = index / columns * static_cast<size_t>(layout.height);
  const size_t row_bytes = size_t{4} * static_cast<size_t>(image.width);
  for (size_t y = 0; y < static_cast<size_t>(image.height); ++y) {
    cancel_point();
    std::copy_n(&image.rgba[y * row_bytes], row_bytes,
                &sheet.rgba[4 * ((top + y) * static_cast<size_t>(sheet.width) + left)]);
  }
}

}  // namespace voxeld
