// JPEG by libjpeg-turbo's classic interface. TurboJPEG's decodes a whole image by one call, which
// could neither be cancelled nor count the scans of a progressive image.
#include <cstddef>
#include <cstdio>
//
#include <jerror.h>
#include <jpeglib.h>

#include <csetjmp>

#include "server/base/cancel_point.h"
#include "server/scene/images/decoders.h"

namespace voxeld {
namespace {

// Scans of a progressive image. Real ones have about ten. Each scan may take as long as the whole
// image and a few bytes. More: malformed-image.
constexpr int kScansMax = 500;

class JpegReader {
 public:
  explicit JpegReader(std::span<const uint8_t> bytes) : bytes_(bytes) {
    jpeg_.err = jpeg_std_error(&errors_);
    errors_.error_exit = on_error;
    errors_.emit_message = on_message;
    progress_.progress_monitor = on_progress;
    jpeg_.client_data = this;
  }
  ~JpegReader() { jpeg_destroy_decompress(&jpeg_); }
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;

  const char* error() const { return message_; }
  int64_t width() const { return jpeg_.image_width; }
  int64_t height() const { return jpeg_.image_height; }
  int channel_count() const { return jpeg_.num_components; }
  bool is_cmyk() const { return jpeg_.out_color_space == JCS_CMYK; }

  bool read_header() {
    return guarded([&] {
      jpeg_create_decompress(&jpeg_);
      jpeg_.progress = &progress_;
      jpeg_mem_src(&jpeg_, bytes_.data(), static_cast<unsigned long>(bytes_.size()));
      jpeg_read_header(&jpeg_, TRUE);
    });
  }
  // Reads all scans of a progressive image.
  bool start() {
    // libjpeg converts neither CMYK nor YCCK to RGB.
    const bool is_rgb = jpeg_.jpeg_color_space != JCS_CMYK && jpeg_.jpeg_color_space != JCS_YCCK;
    jpeg_.out_color_space = is_rgb ? JCS_EXT_RGBA : JCS_CMYK;
    return guarded([&] { jpeg_start_decompress(&jpeg_); });
  }
  // Reads four bytes for each pixel.
  bool read_row(uint8_t* row) {
    return guarded([&] { jpeg_read_scanlines(&jpeg_, &row, 1); });
  }

 private:
  static JpegReader* reader_of(j_common_ptr jpeg) {
    return static_cast<JpegReader*>(jpeg->client_data);
  }
  [[noreturn]] static void fail(JpegReader* reader, const char* what) {
    std::snprintf(reader->message_, sizeof reader->message_, "%s", what);
    std::longjmp(reader->jump_, 1);
  }
  [[noreturn]] static void on_error(j_common_ptr jpeg) {
    char text[JMSG_LENGTH_MAX] = {};
    jpeg->err->format_message(jpeg, text);
    fail(reader_of(jpeg), text);
  }
  // Libjpeg goes on after warnings. One of them means that pixels are missing.
  static void on_message(j_common_ptr jpeg, int level) {
    if (level < 0 && jpeg->err->msg_code == JWRN_HIT_MARKER) {
      fail(reader_of(jpeg), "the image is cut off");
    }
  }
  static void on_progress(j_common_ptr jpeg) {
    // read_row() and start() fail, and their caller throws.
    if (is_cancelled()) fail(reader_of(jpeg), "cancelled");
    if (reinterpret_cast<j_decompress_ptr>(jpeg)->input_scan_number > kScansMax) {
      fail(reader_of(jpeg), "too many scans");
    }
  }

  // Runs calls of libjpeg. Returns false if one of them failed.
  template <typename Call>
  bool guarded(const Call& call) {
    if (setjmp(jump_) != 0) return false;
    call();
    return true;
  }

  std::span<const uint8_t> bytes_;
  jpeg_decompress_struct jpeg_{};
  jpeg_error_mgr errors_{};
  jpeg_progress_mgr progress_{};
  std::jmp_buf jump_{};
  char message_[JMSG_LENGTH_MAX] = {};
};

// Files store the four colours inverted, as Adobe's programs do.
void rgb_of_cmyk(uint8_t* row, int width) {
  for (uint8_t* at = row; at < row + 4 * static_cast<ptrdiff_t>(width); at += 4) {
    for (int c = 0; c < 3; ++c) at[c] = static_cast<uint8_t>((at[c] * at[3] + 127) / 255);
    at[3] = 255;
  }
}

Error failed(std::string_view name, const JpegReader& reader) {
  cancel_point();
  return malformed_image(name, reader.error());
}

}  // namespace

Result<Image> decode_jpeg(std::string_view name, std::span<const uint8_t> bytes,
                          PixelBudget* budget) {
  JpegReader reader(bytes);
  if (!reader.read_header()) return failed(name, reader);
  const int channels = reader.channel_count();
  if (channels != 1 && channels != 3 && channels != 4) {
    return Error{ErrorCode::kMalformedImage, std::string(name) + ": channels of the image",
                 "1, 3 or 4", std::to_string(channels)};
  }
  VOXELD_ASSIGN(Image image,
                begin_image(name, reader.width(), reader.height(), bytes.size(), budget));
  if (!reader.start()) return failed(name, reader);
  for (int y = 0; y < image.height; ++y) {
    cancel_point();
    if (!reader.read_row(image_row(image, y))) return failed(name, reader);
    if (reader.is_cmyk()) rgb_of_cmyk(image_row(image, y), image.width);
  }
  return image;
}

}  // namespace voxeld
