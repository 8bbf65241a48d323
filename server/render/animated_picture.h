// Several pictures as one: animated GIF and PNG, and sheets of pictures beside each other.
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

// Writes pictures to a file as they come; what they show loops for ever.
class AnimationWriter {
 public:
  virtual ~AnimationWriter() = default;

  // As many pictures as were told, all of one size. Errors: internal with the words of the file
  // system or the library.
  virtual Status add(const Picture& picture) = 0;
  // Once after the last picture.
  virtual Status finish() = 0;
};

// durations_s: how long each picture is seen, at least one. GIF counts in 1/100 s and PNG in
// 1/1000 s: what rounding takes from a picture the next ones get, so that the whole keeps its
// length; programs show a GIF's pictures for no less than 1/50 s.
//
// GIF by OpenImageIO: up to 256 colours a picture, dithered; without alpha, so that what is not
// opaque lies over white. Errors: unsupported-feature in a build without OpenImageIO, internal.
Result<std::unique_ptr<AnimationWriter>> write_gif(const std::filesystem::path& path,
                                                   const std::vector<double>& durations_s);
// Animated PNG (W3C PNG, third edition, 11.3.4): streams of encode_png() in frames of their own.
// Errors: those of encode_png(), internal.
Result<std::unique_ptr<AnimationWriter>> write_apng(const std::filesystem::path& path,
                                                    const std::vector<double>& durations_s);

// Durations in whole parts of a second, each at least `least`.
std::vector<uint32_t> whole_durations(const std::vector<double>& durations_s, double parts_per_s,
                                      uint32_t least);

// Where the pictures of a sheet stand: row by row from the top left.
struct SheetLayout {
  int columns = 1, rows = 1;
  int width = 1, height = 1;  // pixels, of one picture
};
// columns: 0 for as many as rows, or one more. Errors: invalid-option for a sheet of more than
// limits::kSheetSideMax pixels to a side.
Result<SheetLayout> sheet_layout(size_t count, int columns, int width, int height);
// An empty sheet of that layout.
Picture begin_sheet(const SheetLayout& layout, const std::array<uint8_t, 4>& background);
void place_in_sheet(const SheetLayout& layout, size_t index, const Picture& picture,
                    Picture& sheet);

}  // namespace voxeld
