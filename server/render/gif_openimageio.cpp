// Animated GIF by OpenImageIO, for the module (base/image_module.h). OpenImageIO supports a single
// delay for all images. The delay of each is written into the file afterwards (GIF89a
// specification, 23: graphic control extension).
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <exception>
#include <span>
#include <string>
#include <utility>

#include "server/base/check.h"
#include "server/base/file.h"
#include "server/process/image_module.h"
#include "server/render/animated_image.h"

namespace voxeld {
namespace {

constexpr double kGifPartsPerSecond = 100.0;
constexpr uint32_t kLeastParts = 2;  // programs show shorter delays for 1/10 s

Error gif_error(std::string what) {
  return Error{ErrorCode::kInternal, "encoding GIF: " + std::move(what), "", ""};
}

// The image over white, opaque.
std::vector<uint8_t> opaque(const RenderImage& image) {
  std::vector<uint8_t> rgba = image.rgba;
  for (size_t i = 0; i < rgba.size(); i += 4) {
    const unsigned alpha = rgba[i + 3];
    for (size_t c = i; c < i + 3; ++c) {
      rgba[c] = static_cast<uint8_t>((rgba[c] * alpha + 255u * (255u - alpha) + 127u) / 255u);
    }
    rgba[i + 3] = 255;
  }
  return rgba;
}

// Byte offset after the sub-blocks that begin at `at`; size() if they do not end.
size_t after_sub_blocks(std::span<const uint8_t> gif, size_t at) {
  while (at < gif.size() && gif[at] != 0) at += size_t{gif[at]} + 1;
  return std::min(at + 1, gif.size());
}

size_t color_table_bytes(uint8_t flags) {
  return (flags & 0x80u) != 0 ? size_t{3} << ((flags & 7u) + 1u) : 0;
}

// Sets the delays of the graphic control extensions, in their order. Returns their number.
size_t set_delays(std::span<uint8_t> gif, std::span<const uint32_t> delays) {
  constexpr size_t kHeaderBytes = 13, kDescriptorBytes = 10;
  if (gif.size() < kHeaderBytes) return 0;
  size_t found = 0;
  for (size_t at = kHeaderBytes + color_table_bytes(gif[10]); at + kDescriptorBytes < gif.size();) {
    if (gif[at] == 0x2c) {
      at = after_sub_blocks(gif, at + kDescriptorBytes + color_table_bytes(gif[at + 9]) + 1);
      continue;
    }
    if (gif[at] != 0x21) break;
    if (gif[at + 1] == 0xf9 && found < delays.size()) {
      gif[at + 4] = static_cast<uint8_t>(delays[found]);
      gif[at + 5] = static_cast<uint8_t>(delays[found] >> 8);
      ++found;
    }
    at = after_sub_blocks(gif, at + 2);
  }
  return found;
}

class GifWriter final : public AnimationWriter {
 public:
  GifWriter(std::unique_ptr<OIIO::ImageOutput> output, std::filesystem::path path,
            std::vector<uint32_t> durations)
      : output_(std::move(output)), path_(std::move(path)), durations_(std::move(durations)) {}

  Status add(const RenderImage& image) override {
    VOXELD_CHECK(added_ < durations_.size(), "no more images than were told");
    try {
      if (!open(image)) return gif_error(output_->geterror());
      const std::vector<uint8_t> rgba = opaque(image);
      if (!output_->write_image(OIIO::TypeDesc::UINT8, rgba.data())) {
        return gif_error(output_->geterror());
      }
    } catch (const std::exception& error) {
      return gif_error(error.what());
    }
    ++added_;
    return {};
  }

  Status finish() override {
    VOXELD_CHECK(added_ == durations_.size(), "as many images as were told");
    if (!output_->close()) return gif_error(output_->geterror());
    VOXELD_ASSIGN(std::vector<uint8_t> gif, read_file(path_));
    const size_t found = set_delays(gif, durations_);
    if (found != durations_.size()) {
      return gif_error("the file has " + std::to_string(found) + " of " +
                       std::to_string(durations_.size()) + " images");
    }
    return write_file(path_, gif);
  }

 private:
  bool open(const RenderImage& image) {
    OIIO::ImageSpec spec(image.width, image.height, 4, OIIO::TypeDesc::UINT8);
    spec.attribute("oiio:ColorSpace", "sRGB");
    spec.attribute("gif:Interlacing", 0);
    if (added_ > 0) {
      return output_->open(path_.string(), spec, OIIO::ImageOutput::AppendSubimage);
    }
    const std::vector<OIIO::ImageSpec> all(durations_.size(), spec);
    return output_->open(path_.string(), static_cast<int>(all.size()), all.data());
  }

  std::unique_ptr<OIIO::ImageOutput> output_;
  std::filesystem::path path_;
  std::vector<uint32_t> durations_;
  size_t added_ = 0;
};

Result<std::unique_ptr<AnimationWriter>> write(const std::filesystem::path& path,
                                               const std::vector<double>& durations_s) {
  try {
    auto output = OIIO::ImageOutput::create("images.gif");
    if (output == nullptr) return gif_error(OIIO::geterror());
    return std::unique_ptr<AnimationWriter>(std::make_unique<GifWriter>(
        std::move(output), path, whole_durations(durations_s, kGifPartsPerSecond, kLeastParts)));
  } catch (const std::exception& error) {
    return gif_error(error.what());
  }
}

}  // namespace
}  // namespace voxeld

VOXELD_PUBLISH(voxeld_write_gif, voxeld::write)
