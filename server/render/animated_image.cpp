// The parts that all animated formats share, and contact sheets.
#include "server/render/animated_image.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "proto/limits.h"
#include "proto/options/values.h"
#include "server/base/check.h"
#include "server/base/pieces.h"

namespace voxeld {
namespace {

constexpr double kPartsMax = 65'535.0;  // both formats store 16 bits

// The times that a format stores.
struct TimeUnits {
  std::string_view format;
  std::span<const uint16_t> parts_per_s;  // each divides the first, which is the finest
  double least;                           // parts of the finest
};
constexpr uint16_t kGifUnits[] = {100}, kPngUnits[] = {1000, 100, 10, 1};
constexpr TimeUnits kGifTimes = {"GIF", kGifUnits, 2};  // programs show shorter ones for 1/10 s
constexpr TimeUnits kPngTimes = {"PNG", kPngUnits, 1};

// The time in the finest parts that hold it; nullopt: it is too long for all. finest_parts: of the
// first of the units.
std::optional<ShownTime> stored_time(const TimeUnits& units, double finest_parts) {
  const double finest = units.parts_per_s.front();
  for (const uint16_t parts_per_s : units.parts_per_s) {
    const double wanted = std::floor(finest_parts * parts_per_s / finest + 0.5);
    if (wanted <= kPartsMax) {
      return ShownTime{static_cast<uint16_t>(std::max(wanted, units.least)), parts_per_s};
    }
  }
  return std::nullopt;
}

}  // namespace

Result<std::vector<ShownTime>> shown_times(ImageKind kind, const std::vector<double>& durations_s) {
  const TimeUnits& units = kind == ImageKind::kGif ? kGifTimes : kPngTimes;
  const double finest = units.parts_per_s.front();
  std::vector<ShownTime> times;
  // Times in the finest parts. Rounding the running end, not each duration, keeps the total length
  // right.
  double end = 0.0, shown = 0.0;
  for (const double duration_s : durations_s) {
    end += std::max(duration_s, 0.0) * finest;
    const std::optional<ShownTime> time = stored_time(units, end - shown);
    if (!time) {
      const double coarsest = units.parts_per_s.back();
      return Error{ErrorCode::kInvalidOption,
                   "image: image " + std::to_string(times.size()) + " of the " +
                       std::string(units.format) + " is shown for too long",
                   "at most " + option_values::to_text(kPartsMax / coarsest) +
                       " seconds, by rate or by times that are closer together",
                   option_values::to_text(duration_s) + " seconds"};
    }
    times.push_back(*time);
    shown += finest * time->parts / time->parts_per_s;
  }
  return times;
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
