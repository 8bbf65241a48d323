#include "server/formats/images/png_stream.h"

#include <libdeflate.h>
#include <zlib.h>

#include <algorithm>

#include "server/base/check.h"

namespace voxeld::images {
namespace {

constexpr std::array<uint8_t, 8> kPngSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr std::array<uint8_t, 2> kPngZlibHead = {0x78, 0x01};
constexpr uint8_t kPngFilterNone = 0, kPngFilterUp = 2, kPngPerMetre = 1;
constexpr uint32_t kAdlerOfNoRows = 1;
constexpr std::array<uint8_t, 1> kPerceptual = {0};  // the rendering intent of sRGB

std::array<uint8_t, 4> png_number(uint32_t value) {
  return {static_cast<uint8_t>(value >> 24), static_cast<uint8_t>(value >> 16),
          static_cast<uint8_t>(value >> 8), static_cast<uint8_t>(value)};
}

}  // namespace

DeflatedPiece png_rows(std::span<uint8_t> rows, size_t row_bytes, PngFilter filter) {
  const size_t step = row_bytes + 1;
  VOXELD_CHECK(rows.size() % step == 0, "png: a part has whole rows");
  for (size_t at = rows.size(); at > 0;) {  // the last row first: each needs the one above as it is
    at -= step;
    uint8_t* const row = &rows[at];
    row[0] = filter == PngFilter::kUp && at > 0 ? kPngFilterUp : kPngFilterNone;
    if (row[0] == kPngFilterNone) continue;
    const uint8_t* const above = row - step;
    for (size_t i = 1; i < step; ++i) row[i] = static_cast<uint8_t>(row[i] - above[i]);
  }
  return deflate_piece(rows, Repeats::anywhere(), Checksum::kAdler32);
}

PngStream::PngStream(const PngHeader& header)
    : bytes_(kPngSignature.begin(), kPngSignature.end()), adler_(kAdlerOfNoRows) {
  const auto width = png_number(header.width), height = png_number(header.height);
  const std::array<uint8_t, 5> form = {header.pixel.sample_bits,
                                       static_cast<uint8_t>(header.pixel.color), 0, 0, 0};
  add_chunk("IHDR", std::array<std::span<const uint8_t>, 3>{width, height, form});
  if (header.pixel.color == PngColor::kRgba) {
    add_chunk("sRGB", std::array<std::span<const uint8_t>, 1>{kPerceptual});
  }
  if (std::ranges::count(header.pixels_per_metre, 0U) == 0) {
    const auto x = png_number(header.pixels_per_metre[0]);
    const auto y = png_number(header.pixels_per_metre[1]);
    const std::array<uint8_t, 1> unit = {kPngPerMetre};
    add_chunk("pHYs", std::array<std::span<const uint8_t>, 3>{x, y, unit});
  }
}

void PngStream::add(const DeflatedPiece& rows) {
  adler_ = static_cast<uint32_t>(
      adler32_combine(adler_, rows.checksum, static_cast<z_off_t>(rows.raw_bytes)));
  std::span<const uint8_t> head;
  if (!has_rows_) head = kPngZlibHead;
  has_rows_ = true;
  add_chunk("IDAT", std::array<std::span<const uint8_t>, 2>{head, rows.deflated});
}

std::vector<uint8_t> PngStream::finish() {
  const auto sum = png_number(adler_);
  add_chunk("IDAT", std::array<std::span<const uint8_t>, 2>{Deflater::stream_end(), sum});
  add_chunk("IEND", {});
  return std::move(bytes_);
}

// The checksum is that of the type and the parts.
void PngStream::add_chunk(std::string_view type, std::span<const std::span<const uint8_t>> parts) {
  size_t length = 0;
  for (const auto part : parts) length += part.size();
  const auto number = png_number(static_cast<uint32_t>(length));
  bytes_.insert(bytes_.end(), number.begin(), number.end());
  const size_t begin = bytes_.size();
  bytes_.insert(bytes_.end(), type.begin(), type.end());
  for (const auto part : parts) bytes_.insert(bytes_.end(), part.begin(), part.end());
  const auto sum = png_number(libdeflate_crc32(0, bytes_.data() + begin, bytes_.size() - begin));
  bytes_.insert(bytes_.end(), sum.begin(), sum.end());
}

}  // namespace voxeld::images
