// Several images in one file: animated GIF and PNG, and contact sheets.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "proto/result.h"
#include "server/render/render.h"

namespace voxeld {

// Writes images to a file as they come. The animation loops for ever.
class AnimationWriter {
 public:
  virtual ~AnimationWriter() = default;

  // Adds an image. There must be as many as durations, all of one size. Errors: internal with the
  // words of the file system or the library.
  virtual Status add(const RenderImage& image) = 0;
  // Called once after the last image.
  virtual Status finish() = 0;
};

// An animated GIF: up to 256 colours an image, dithered if it has more. GIF has no alpha, so
// transparent pixels are blended with white. durations_s: display time of each image; at least one.
// Programs show a GIF's images for at least 1/50 s. Errors: those of shown_times(), internal. Has
// cancellation points.
Result<std::unique_ptr<AnimationWriter>> write_gif(const std::filesystem::path& path,
                                                   const std::vector<double>& durations_s);
// An animated PNG (W3C PNG, third edition, 11.3.4): streams of encode_png(), each in a frame of its
// own. Errors: those of shown_times() and encode_png(), internal.
Result<std::unique_ptr<AnimationWriter>> write_apng(const std::filesystem::path& path,
                                                    const std::vector<double>& durations_s);

// How long an image is shown: parts / parts_per_s seconds.
struct ShownTime {
  uint16_t parts = 0, parts_per_s = 1;
};
// The durations as files of the kind, kGif or kApng, store them. GIF counts in 1/100 s, PNG in
// 1/1000 s, and in 1/100, 1/10 or whole seconds where an image is shown for too many of those.
// Rounding errors are carried to the next images, so that the total length is right. Errors:
// invalid-option for more than 655.35 s in a GIF, or 65,535 s in a PNG.
Result<std::vector<ShownTime>> shown_times(ImageKind kind, const std::vector<double>& durations_s);

// The layout of a sheet: images row by row from the top left.
struct SheetLayout {
  int columns = 1, rows = 1;
  int width = 1, height = 1;  // size of one image, in pixels
};
// columns: 0 means as many as rows, or one more. Errors: invalid-option if the sheet exceeds
// limits::kSheetSideMax pixels a side.
Result<SheetLayout> sheet_layout(size_t count, int columns, int width, int height);
// An empty sheet of that layout.
RenderImage begin_sheet(const SheetLayout& layout, const std::array<uint8_t, 4>& background);
void place_in_sheet(const SheetLayout& layout, size_t index, const RenderImage& image,
                    RenderImage& sheet);

}  // namespace voxeld
