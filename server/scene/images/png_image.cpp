// PNG by libpng. Colours are taken as sRGB: chunks of gamma and colour profiles are not read.
#include <png.h>

#include <csetjmp>
#include <cstdio>
#include <cstring>

#include "server/base/cancel_point.h"
#include "server/scene/images/decoders.h"

namespace voxeld {
namespace {

class PngReader {
 public:
  explicit PngReader(std::span<const uint8_t> bytes) : bytes_(bytes) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, on_error, on_warning);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  const char* error() const { return message_; }
  int64_t width() const { return png_get_image_width(png_, info_); }
  int64_t height() const { return png_get_image_height(png_, info_); }

  // Reads up to the pixels, and asks for 8 bits RGBA. Returns the number of passes, 0 for an error.
  int read_header() {
    if (info_ == nullptr) {
      std::snprintf(message_, sizeof message_, "libpng has no memory");
      return 0;
    }
    int passes = 0;
    const bool ok = guarded([&] {
      png_set_read_fn(png_, this, read_memory);
      // All chunks but IHDR, PLTE, tRNS, IDAT and IEND.
      png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
      png_read_info(png_, info_);
      png_set_expand(png_);
      png_set_scale_16(png_);
      png_set_gray_to_rgb(png_);
      png_set_add_alpha(png_, 0xff, PNG_FILLER_AFTER);
      passes = png_set_interlace_handling(png_);
    });
    return ok ? passes : 0;
  }

  bool start() {
    return guarded([&] { png_start_read_image(png_); });
  }
  // The rows of an interlaced image are read once for each pass and keep what they have.
  bool read_row(uint8_t* rgba) {
    return guarded([&] { png_read_row(png_, rgba, nullptr); });
  }

 private:
  [[noreturn]] static void on_error(png_structp png, png_const_charp what) {
    auto* reader = static_cast<PngReader*>(png_get_error_ptr(png));
    std::snprintf(reader->message_, sizeof reader->message_, "%s", what);
    png_longjmp(png, 1);
  }
  static void on_warning(png_structp, png_const_charp) {}
  static void read_memory(png_structp png, png_bytep to, size_t count) {
    auto* reader = static_cast<PngReader*>(png_get_io_ptr(png));
    // A call may read a whole chunk. It fails, and its caller throws.
    if (is_cancelled()) png_error(png, "cancelled");
    if (count > reader->bytes_.size()) png_error(png, "the image is cut off");
    std::memcpy(to, reader->bytes_.data(), count);
    reader->bytes_ = reader->bytes_.subspan(count);
  }

  // Runs calls of libpng. Returns false if one of them failed.
  template <typename Call>
  bool guarded(const Call& call) {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    call();
    return true;
  }

  std::span<const uint8_t> bytes_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  char message_[200] = {};
};

Error failed(std::string_view name, const PngReader& reader) {
  cancel_point();
  return malformed_image(name, reader.error());
}

}  // namespace

Result<Image> decode_png(std::string_view name, std::span<const uint8_t> bytes,
                         PixelBudget* budget) {
  PngReader reader(bytes);
  const int passes = reader.read_header();
  if (passes == 0) return failed(name, reader);
  VOXELD_ASSIGN(Image image,
                begin_image(name, reader.width(), reader.height(), bytes.size(), budget));
  if (!reader.start()) return failed(name, reader);
  for (int pass = 0; pass < passes; ++pass) {
    for (int y = 0; y < image.height; ++y) {
      cancel_point();
      if (!reader.read_row(image_row(image, y))) return failed(name, reader);
    }
  }
  return image;
}

}  // namespace voxeld
