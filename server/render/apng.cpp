// Animated PNG: the streams of ordinary PNGs in other chunks.
//
//   signature, IHDR and the other chunks before the first image's IDAT
//   acTL  u32 images, u32 rounds (0: for ever)
//   per image
//     fcTL  u32 number, width, height, x, y; u16 delay, u16 its denominator; u8 dispose, u8 blend
//     IDAT of the first, fdAT (u32 number, then the same stream) of the others
//   IEND
//
// Numbers count fcTL and fdAT chunks together, from 0. All numbers are big-endian.
#include <fcntl.h>
#include <zlib.h>

#include <span>
#include <string_view>
#include <utility>

#include "server/base/check.h"
#include "server/base/disk/file.h"
#include "server/render/animated_image.h"

namespace voxeld {
namespace {

constexpr size_t kSignatureBytes = 8, kChunkFrameBytes = 12;

uint32_t read_u32(const uint8_t* at) {
  return uint32_t{at[0]} << 24 | uint32_t{at[1]} << 16 | uint32_t{at[2]} << 8 | uint32_t{at[3]};
}

void put_u32(std::vector<uint8_t>& out, uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<uint8_t>(value >> shift));
}

void put_u16(std::vector<uint8_t>& out, uint32_t value) {
  out.push_back(static_cast<uint8_t>(value >> 8));
  out.push_back(static_cast<uint8_t>(value));
}

void append(std::vector<uint8_t>& out, std::span<const uint8_t> bytes) {
  out.insert(out.end(), bytes.begin(), bytes.end());
}

void put_chunk(std::vector<uint8_t>& out, std::string_view type, std::span<const uint8_t> data) {
  put_u32(out, static_cast<uint32_t>(data.size()));
  const size_t begin = out.size();
  out.insert(out.end(), type.begin(), type.end());
  append(out, data);
  const auto length = static_cast<uInt>(out.size() - begin);
  put_u32(out, static_cast<uint32_t>(crc32(0, out.data() + begin, length)));
}

// The parts of an encoded image.
struct PngParts {
  std::vector<uint8_t> front;                     // signature and chunks before the stream
  std::vector<std::span<const uint8_t>> streams;  // data of IDAT chunks
};

PngParts parts_of(std::span<const uint8_t> png) {
  PngParts parts;
  append(parts.front, png.first(kSignatureBytes));
  for (size_t at = kSignatureBytes; at + kChunkFrameBytes <= png.size();) {
    const size_t bytes = read_u32(&png[at]);
    const std::string_view type(reinterpret_cast<const char*>(&png[at + 4]), 4);
    if (type == "IDAT") {
      parts.streams.push_back(png.subspan(at + 8, bytes));
    } else if (parts.streams.empty()) {
      append(parts.front, png.subspan(at, bytes + kChunkFrameBytes));
    }
    at += bytes + kChunkFrameBytes;
  }
  return parts;
}

class ApngWriter final : public AnimationWriter {
 public:
  ApngWriter(UniqueFd fd, std::vector<ShownTime> times)
      : fd_(std::move(fd)), times_(std::move(times)) {}

  Status add(const RenderImage& image) override {
    VOXELD_CHECK(added_ < times_.size(), "no more images than were told");
    VOXELD_ASSIGN(const std::vector<uint8_t> png, encode_png(image));
    const PngParts parts = parts_of(png);
    std::vector<uint8_t> out;
    if (added_ == 0) {
      append(out, parts.front);
      std::vector<uint8_t> control;
      put_u32(control, static_cast<uint32_t>(times_.size()));
      put_u32(control, 0);
      put_chunk(out, "acTL", control);
    }
    put_frame_control(out, image);
    for (const std::span<const uint8_t> stream : parts.streams) put_stream(out, stream);
    ++added_;
    return write_all(fd_.get(), out);
  }

  Status finish() override {
    VOXELD_CHECK(added_ == times_.size(), "as many images as were told");
    std::vector<uint8_t> out;
    put_chunk(out, "IEND", {});
    return write_all(fd_.get(), out);
  }

 private:
  void put_frame_control(std::vector<uint8_t>& out, const RenderImage& image) {
    std::vector<uint8_t> control;
    put_u32(control, number_++);
    put_u32(control, static_cast<uint32_t>(image.width));
    put_u32(control, static_cast<uint32_t>(image.height));
    put_u32(control, 0);
    put_u32(control, 0);
    put_u16(control, times_[added_].parts);
    put_u16(control, times_[added_].parts_per_s);
    // dispose and blend: the next image replaces this one, alpha included.
    control.insert(control.end(), {0, 0});
    put_chunk(out, "fcTL", control);
  }

  void put_stream(std::vector<uint8_t>& out, std::span<const uint8_t> stream) {
    if (added_ == 0) return put_chunk(out, "IDAT", stream);
    std::vector<uint8_t> data;
    data.reserve(4 + stream.size());
    put_u32(data, number_++);
    append(data, stream);
    put_chunk(out, "fdAT", data);
  }

  UniqueFd fd_;
  std::vector<ShownTime> times_;
  size_t added_ = 0;
  uint32_t number_ = 0;  // number of the next fcTL or fdAT
};

}  // namespace

Result<std::unique_ptr<AnimationWriter>> write_apng(const std::filesystem::path& path,
                                                    const std::vector<double>& durations_s) {
  VOXELD_ASSIGN(std::vector<ShownTime> times, shown_times(ImageKind::kApng, durations_s));
  UniqueFd fd(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  if (!fd.valid()) return errno_error("create", path);
  return std::unique_ptr<AnimationWriter>(
      std::make_unique<ApngWriter>(std::move(fd), std::move(times)));
}

}  // namespace voxeld
