// The first frame of a GIF by giflib, on a transparent canvas.
#include <gif_lib.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/scene/images/decoders.h"

namespace voxeld {
namespace {

// The first row of a pass over an interlaced frame, and the step between its rows (GIF89a
// specification, appendix E).
struct Pass {
  int first, step;
};
constexpr Pass kInterlaced[] = {{0, 8}, {4, 8}, {2, 4}, {1, 2}};
constexpr Pass kInOrder[] = {{0, 1}};

int read_gif(GifFileType* gif, GifByteType* to, int count) {
  auto* bytes = static_cast<std::span<const uint8_t>*>(gif->UserData);
  const size_t taken = std::min(static_cast<size_t>(std::max(count, 0)), bytes->size());
  if (taken > 0) std::memcpy(to, bytes->data(), taken);
  *bytes = bytes->subspan(taken);
  return static_cast<int>(taken);
}

struct CloseGif {
  void operator()(GifFileType* gif) const {
    int code = 0;
    DGifCloseFile(gif, &code);
  }
};
using Gif = std::unique_ptr<GifFileType, CloseGif>;

Error gif_error(std::string_view name, int code) {
  const char* words = GifErrorString(code);
  return malformed_image(name, words != nullptr ? words : "not a valid GIF");
}

// Reads the records before the first frame. Returns the index of the transparent colour, -1 for
// none, or nullopt for an error, or if there is no frame.
std::optional<int> go_to_first_frame(GifFileType* gif) {
  int transparent = NO_TRANSPARENT_COLOR;
  GifRecordType type = UNDEFINED_RECORD_TYPE;
  while (DGifGetRecordType(gif, &type) == GIF_OK) {
    cancel_point();
    if (type == IMAGE_DESC_RECORD_TYPE) return transparent;
    if (type == TERMINATE_RECORD_TYPE) return std::nullopt;
    if (type != EXTENSION_RECORD_TYPE) continue;
    int code = 0;
    GifByteType* block = nullptr;  // its length, then its bytes
    if (DGifGetExtension(gif, &code, &block) == GIF_ERROR) return std::nullopt;
    GraphicsControlBlock control;
    if (code == GRAPHICS_EXT_FUNC_CODE && block != nullptr &&
        DGifExtensionToGCB(block[0], block + 1, &control) == GIF_OK) {
      transparent = control.TransparentColor;
    }
    while (block != nullptr) {
      cancel_point();
      if (DGifGetExtensionNext(gif, &block) == GIF_ERROR) return std::nullopt;
    }
  }
  return std::nullopt;
}

// Reads the frame into the image. Returns whether all its rows were there.
bool read_rows(GifFileType* gif, const ColorMapObject& colors, int transparent, Image& image) {
  const GifImageDesc frame = gif->Image;
  std::vector<GifPixelType> row(static_cast<size_t>(frame.Width));
  const std::span<const Pass> passes =
      frame.Interlace ? std::span<const Pass>(kInterlaced) : std::span<const Pass>(kInOrder);
  for (const Pass& pass : passes) {
    for (int y = pass.first; y < frame.Height; y += pass.step) {
      cancel_point();
      if (DGifGetLine(gif, row.data(), frame.Width) == GIF_ERROR) return false;
      uint8_t* to = image_row(image, frame.Top + y) + 4 * static_cast<ptrdiff_t>(frame.Left);
      for (const int index : row) {
        if (index != transparent && index < colors.ColorCount) {
          const GifColorType& color = colors.Colors[index];
          to[0] = color.Red;
          to[1] = color.Green;
          to[2] = color.Blue;
          to[3] = 255;
        }
        to += 4;
      }
    }
  }
  return true;
}

}  // namespace

Result<Image> decode_gif(std::string_view name, std::span<const uint8_t> bytes,
                         PixelBudget* budget) {
  std::span<const uint8_t> left = bytes;
  int code = 0;
  const Gif gif(DGifOpen(&left, read_gif, &code));
  if (gif == nullptr) return gif_error(name, code);
  VOXELD_TRY(check_image_size(name, gif->SWidth, gif->SHeight));
  const std::optional<int> transparent = go_to_first_frame(gif.get());
  if (!transparent || DGifGetImageDesc(gif.get()) == GIF_ERROR) return gif_error(name, gif->Error);
  const GifImageDesc& frame = gif->Image;
  if (frame.Width <= 0 || frame.Height <= 0 || frame.Left + frame.Width > gif->SWidth ||
      frame.Top + frame.Height > gif->SHeight) {
    return Error{
        ErrorCode::kMalformedImage, std::string(name) + ": the first frame",
        "within " + std::to_string(gif->SWidth) + " x " + std::to_string(gif->SHeight) + " pixels",
        std::to_string(frame.Width) + " x " + std::to_string(frame.Height) + " at " +
            std::to_string(frame.Left) + ", " + std::to_string(frame.Top)};
  }
  const ColorMapObject* colors = frame.ColorMap != nullptr ? frame.ColorMap : gif->SColorMap;
  if (colors == nullptr) return malformed_image(name, "the first frame has no palette");
  VOXELD_ASSIGN(Image image, begin_image(name, gif->SWidth, gif->SHeight, bytes.size(), budget));
  if (!read_rows(gif.get(), *colors, *transparent, image)) return gif_error(name, gif->Error);
  return image;
}

}  // namespace voxeld
