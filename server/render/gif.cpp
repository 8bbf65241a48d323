// Animated GIF by giflib.
#include <fcntl.h>
#include <gif_lib.h>

#include <algorithm>
#include <bit>
#include <memory>
#include <new>
#include <string>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/check.h"
#include "server/base/disk/file.h"
#include "server/base/pieces.h"
#include "server/render/animated_image.h"
#include "server/render/gif_palette.h"

namespace voxeld {
namespace {

// The image over white.
std::vector<uint8_t> opaque_rgb(const RenderImage& image) {
  std::vector<uint8_t> rgb;
  rgb.reserve(image.rgba.size() / 4 * 3);
  for (size_t i = 0; i < image.rgba.size(); i += 4) {
    cancel_point_at(i);
    const unsigned alpha = image.rgba[i + 3];
    for (size_t c = i; c < i + 3; ++c) {
      rgb.push_back(
          static_cast<uint8_t>((image.rgba[c] * alpha + 255u * (255u - alpha) + 127u) / 255u));
    }
  }
  return rgb;
}

struct FreeColorMap {
  void operator()(ColorMapObject* map) const { GifFreeMapObject(map); }
};
using ColorMap = std::unique_ptr<ColorMapObject, FreeColorMap>;

// Tables have a power of two of colours, at least two.
ColorMap color_map(const std::vector<std::array<uint8_t, 3>>& palette) {
  const size_t size = std::bit_ceil(std::max<size_t>(palette.size(), 2));
  ColorMap map(GifMakeMapObject(static_cast<int>(size), nullptr));
  if (map == nullptr) return map;
  for (size_t i = 0; i < palette.size(); ++i) {
    map->Colors[i] = {palette[i][0], palette[i][1], palette[i][2]};
  }
  return map;
}

class GifWriter final : public AnimationWriter {
 public:
  GifWriter(UniqueFd fd, std::vector<ShownTime> times)
      : fd_(std::move(fd)), times_(std::move(times)) {}
  ~GifWriter() override { (void)close(); }
  GifWriter(const GifWriter&) = delete;
  GifWriter& operator=(const GifWriter&) = delete;

  Status add(const RenderImage& image) override {
    VOXELD_CHECK(added_ < times_.size(), "no more images than were told");
    const IndexedImage indexed = reduce_colors(opaque_rgb(image), image.width);
    const ColorMap colors = color_map(indexed.palette);
    if ((gif_ == nullptr && !open(image)) || colors == nullptr || !put_delay() ||
        EGifPutImageDesc(gif_, 0, 0, image.width, image.height, false, colors.get()) != GIF_OK) {
      return gif_error();
    }
    std::vector<GifPixelType> row(static_cast<size_t>(image.width));
    for (int y = 0; y < image.height; ++y) {
      cancel_point();
      // A copy, as giflib may write to it.
      std::copy_n(&indexed.indices[static_cast<size_t>(y) * row.size()], row.size(), row.begin());
      if (EGifPutLine(gif_, row.data(), image.width) != GIF_OK) return gif_error();
    }
    ++added_;
    return flush();
  }

  Status finish() override {
    VOXELD_CHECK(added_ == times_.size(), "as many images as were told");
    if (!close()) return gif_error();
    return flush();
  }

 private:
  // No exception may pass through giflib.
  static int append(GifFileType* gif, const GifByteType* data, int count) noexcept {
    try {
      auto& bytes = static_cast<GifWriter*>(gif->UserData)->bytes_;
      bytes.insert(bytes.end(), data, data + count);
      return count;
    } catch (const std::bad_alloc&) {
      return 0;
    }
  }

  bool open(const RenderImage& image) {
    gif_ = EGifOpen(this, append, &code_);
    if (gif_ == nullptr) return false;
    EGifSetGifVersion(gif_, true);  // 89a
    constexpr int kBitsPerChannel = 8;
    static constexpr uint8_t kForEver[] = {1, 0, 0};
    return EGifPutScreenDesc(gif_, image.width, image.height, kBitsPerChannel, 0, nullptr) ==
               GIF_OK &&
           EGifPutExtensionLeader(gif_, APPLICATION_EXT_FUNC_CODE) == GIF_OK &&
           EGifPutExtensionBlock(gif_, 11, "NETSCAPE2.0") == GIF_OK &&
           EGifPutExtensionBlock(gif_, sizeof kForEver, kForEver) == GIF_OK &&
           EGifPutExtensionTrailer(gif_) == GIF_OK;
  }

  bool put_delay() {
    const GraphicsControlBlock control{.DisposalMode = DISPOSE_DO_NOT,
                                       .UserInputFlag = false,
                                       .DelayTime = times_[added_].parts,
                                       .TransparentColor = NO_TRANSPARENT_COLOR};
    std::array<GifByteType, 4> bytes{};
    const size_t count = EGifGCBToExtension(&control, bytes.data());
    return EGifPutExtension(gif_, GRAPHICS_EXT_FUNC_CODE, static_cast<int>(count), bytes.data()) ==
           GIF_OK;
  }

  bool close() {
    GifFileType* gif = std::exchange(gif_, nullptr);
    return gif == nullptr || EGifCloseFile(gif, &code_) == GIF_OK;
  }

  Status flush() {
    Status written = write_all(fd_.get(), bytes_);
    bytes_.clear();
    return written;
  }

  Error gif_error() const {
    const char* words = GifErrorString(gif_ != nullptr ? gif_->Error : code_);
    return Error{ErrorCode::kInternal,
                 std::string("encoding GIF: ") + (words != nullptr ? words : "out of memory"), "",
                 ""};
  }

  UniqueFd fd_;
  std::vector<ShownTime> times_;
  size_t added_ = 0;
  std::vector<uint8_t> bytes_;  // not yet written
  GifFileType* gif_ = nullptr;  // from the first image on
  int code_ = 0;
};

}  // namespace

Result<std::unique_ptr<AnimationWriter>> write_gif(const std::filesystem::path& path,
                                                   const std::vector<double>& durations_s) {
  VOXELD_ASSIGN(std::vector<ShownTime> times, shown_times(ImageKind::kGif, durations_s));
  UniqueFd fd(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  if (!fd.valid()) return errno_error("create", path);
  return std::unique_ptr<AnimationWriter>(
      std::make_unique<GifWriter>(std::move(fd), std::move(times)));
}

}  // namespace voxeld
