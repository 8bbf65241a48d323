// The colours of a PNG image (ISO/IEC 15948): of its palette, or of its pixels. Interlaced images
// are refused. Each chunk's checksum is verified.
//
//   signature  IHDR(width height depth type 0 0 interlace)  PLTE?  tRNS?  IDAT+  IEND
//   chunk: length, id, data, CRC-32 of id and data; big-endian
#include <zlib.h>

#include <array>
#include <cstdlib>
#include <memory>
#include <optional>

#include "proto/palette_files/readers.h"
#include "proto/text/text_file.h"

namespace voxeld::palette_files {
namespace {

constexpr size_t kSignatureBytes = 8;
// More pixels are a picture rather than a palette; they would only take time.
constexpr uint64_t kPixelsMax = uint64_t{1} << 20;

enum ColorType : uint8_t { kGray = 0, kRgb = 2, kIndexed = 3, kGrayAlpha = 4, kRgba = 6 };

struct Header {
  uint32_t width = 0, height = 0;
  uint32_t depth = 0;  // bits of a sample
  uint32_t type = 0;

  size_t samples() const {
    constexpr std::array<size_t, 7> kSamples = {1, 0, 3, 1, 2, 0, 4};
    return kSamples[type];
  }
  size_t row_bytes() const { return (width * samples() * depth + 7) / 8; }
  // From a sample to the one before it, for filters.
  size_t step() const { return std::max<size_t>(1, samples() * depth / 8); }
};

bool is_known(const Header& header) {
  switch (header.type) {
    case kGray:
      return header.depth == 1 || header.depth == 2 || header.depth == 4 || header.depth == 8 ||
             header.depth == 16;
    case kIndexed:
      return header.depth == 1 || header.depth == 2 || header.depth == 4 || header.depth == 8;
    case kRgb:
    case kGrayAlpha:
    case kRgba:
      return header.depth == 8 || header.depth == 16;
    default:
      return false;
  }
}

struct Chunks {
  Header header;
  Bytes palette, transparency;
  std::vector<Bytes> data;
};

Result<Header> read_header(Cursor& cursor, Bytes chunk, const FileColors& colors) {
  Header header;
  Cursor in(chunk, colors);
  VOXELD_ASSIGN(header.width, in.big(4, "the width"));
  VOXELD_ASSIGN(header.height, in.big(4, "the height"));
  VOXELD_ASSIGN(header.depth, in.big(1, "the depth"));
  VOXELD_ASSIGN(header.type, in.big(1, "the colour type"));
  VOXELD_ASSIGN(const uint32_t methods, in.big(2, "the methods"));
  VOXELD_ASSIGN(const uint32_t interlace, in.big(1, "the interlace method"));
  const uint64_t pixels = uint64_t{header.width} * header.height;
  if (pixels == 0 || pixels > kPixelsMax) {
    return cursor.error("an image of 1 to " + std::to_string(kPixelsMax) + " pixels",
                        std::to_string(header.width) + " x " + std::to_string(header.height));
  }
  if (!is_known(header) || methods != 0) {
    return cursor.error(
        "a colour type and depth of PNG",
        "type " + std::to_string(header.type) + " with " + std::to_string(header.depth) + " bits");
  }
  if (interlace != 0) return cursor.error("an image that is not interlaced", "interlacing");
  return header;
}

// Takes a chunk, whose checksum must be right.
Result<Bytes> take_chunk(Cursor& cursor, std::string_view& id) {
  const Cursor start = cursor;
  VOXELD_ASSIGN(const uint32_t length, cursor.big(4, "a chunk's length"));
  Cursor summed = cursor;
  VOXELD_ASSIGN(const Bytes name, cursor.take(4, "a chunk's id"));
  id = as_text(name);
  VOXELD_ASSIGN(const Bytes data, cursor.take(length, "a chunk"));
  VOXELD_ASSIGN(const Bytes whole, summed.take(size_t{4} + length, "a chunk"));
  VOXELD_ASSIGN(const uint32_t sum, cursor.big(4, "a chunk's checksum"));
  if (crc32_z(0, whole.data(), whole.size()) == sum) return data;
  return start.error("a chunk with the right checksum", "a wrong one of " + shown(id));
}

Result<Chunks> read_chunks(Bytes bytes, const FileColors& colors) {
  Chunks chunks;
  Cursor cursor(bytes, colors);
  VOXELD_TRY(cursor.take(kSignatureBytes, "the signature"));
  std::string_view id;
  Cursor start = cursor;
  VOXELD_ASSIGN(const Bytes first, take_chunk(cursor, id));
  if (id != "IHDR") return start.error("a chunk 'IHDR'", shown(id));
  VOXELD_ASSIGN(chunks.header, read_header(start, first, colors));
  while (id != "IEND") {
    VOXELD_ASSIGN(const Bytes data, take_chunk(cursor, id));
    if (id == "PLTE") chunks.palette = data;
    if (id == "tRNS") chunks.transparency = data;
    if (id == "IDAT") chunks.data.push_back(data);
  }
  return chunks;
}

Status add_entries(const Chunks& chunks, FileColors& colors) {
  const Bytes palette = chunks.palette;
  if (palette.empty() || palette.size() % 3 != 0 || palette.size() > 3 * kPaletteColorsMax) {
    return colors.error("chunk PLTE", "1 to 256 colours of 3 bytes",
                        std::to_string(palette.size()) + " bytes");
  }
  for (size_t i = 0; i < palette.size() / 3; ++i) {
    if (i < chunks.transparency.size() && chunks.transparency[i] == 0) continue;
    VOXELD_TRY(colors.add({palette[3 * i], palette[3 * i + 1], palette[3 * i + 2]}));
  }
  return {};
}

// Inflates the rows of an image one after the other.
class Inflater {
 public:
  explicit Inflater(const std::vector<Bytes>& data) : data_(data) {}
  ~Inflater() {
    if (is_open_) inflateEnd(&stream_);
  }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  bool open() { return is_open_ = inflateInit(&stream_) == Z_OK; }

  // Whether so many bytes came.
  bool fill(std::span<uint8_t> out) {
    stream_.next_out = out.data();
    stream_.avail_out = static_cast<uInt>(out.size());
    while (stream_.avail_out > 0) {
      if (stream_.avail_in == 0 && next_ < data_.size()) {
        const Bytes piece = data_[next_++];
        stream_.next_in = piece.data();
        stream_.avail_in = static_cast<uInt>(piece.size());
        continue;  // a piece may be empty
      }
      const int status = inflate(&stream_, Z_NO_FLUSH);
      if (status == Z_STREAM_END) return stream_.avail_out == 0;
      if (status != Z_OK) return false;
    }
    return true;
  }

 private:
  const std::vector<Bytes>& data_;
  size_t next_ = 0;
  bool is_open_ = false;
  z_stream stream_{};
};

// The predictor of filter 4: of left, above and their common neighbour the one nearest to their
// plane.
uint8_t paeth(int left, int above, int corner) {
  const int estimate = left + above - corner;
  const int to_left = std::abs(estimate - left), to_above = std::abs(estimate - above);
  const int to_corner = std::abs(estimate - corner);
  if (to_left <= to_above && to_left <= to_corner) return static_cast<uint8_t>(left);
  return static_cast<uint8_t>(to_above <= to_corner ? above : corner);
}

// Reverses a row's filter. `above`: the row before it, zeros for the first. Returns whether there
// is such a filter.
bool unfilter(uint8_t filter, std::span<uint8_t> row, Bytes above, size_t step) {
  constexpr uint8_t kPaeth = 4;
  if (filter > kPaeth) return false;
  for (size_t i = 0; i < row.size(); ++i) {
    const int left = i >= step ? row[i - step] : 0;
    const int corner = i >= step ? above[i - step] : 0;
    int predicted = 0;
    if (filter == 1) predicted = left;
    if (filter == 2) predicted = above[i];
    if (filter == 3) predicted = (left + above[i]) / 2;
    if (filter == kPaeth) predicted = paeth(left, above[i], corner);
    row[i] = static_cast<uint8_t>(row[i] + predicted);
  }
  return true;
}

// Reads samples of a row as they are stored, and as bytes.
class RowSamples {
 public:
  RowSamples(const Header& header, Bytes row) : header_(header), row_(row) {}

  uint32_t raw(size_t index) const {
    if (header_.depth == 16) return uint32_t{row_[2 * index]} << 8 | row_[2 * index + 1];
    const size_t per_byte = 8 / header_.depth;
    const size_t shift = 8 - header_.depth * (index % per_byte + 1);
    return row_[index / per_byte] >> shift & ((1u << header_.depth) - 1);
  }
  uint8_t byte(size_t index) const {
    const uint32_t max = (1u << header_.depth) - 1;
    return static_cast<uint8_t>((raw(index) * 255 + max / 2) / max);
  }

 private:
  const Header& header_;
  Bytes row_;
};

// The colour that tRNS makes transparent.
std::optional<std::array<uint32_t, 3>> transparent_samples(const Chunks& chunks) {
  const size_t samples = chunks.header.samples();
  if (chunks.header.type != kGray && chunks.header.type != kRgb) return std::nullopt;
  if (chunks.transparency.size() != 2 * samples) return std::nullopt;
  std::array<uint32_t, 3> values{};
  for (size_t i = 0; i < samples; ++i) {
    values[i] = uint32_t{chunks.transparency[2 * i]} << 8 | chunks.transparency[2 * i + 1];
  }
  return values;
}

Status add_row(const Chunks& chunks, Bytes row, FileColors& colors) {
  const Header& header = chunks.header;
  const RowSamples values(header, row);
  const size_t samples = header.samples();
  const bool has_alpha = header.type == kGrayAlpha || header.type == kRgba;
  const bool is_gray = header.type == kGray || header.type == kGrayAlpha;
  const auto transparent = transparent_samples(chunks);
  std::optional<PaletteColor> last;
  for (size_t first = 0; first < header.width * samples; first += samples) {
    if (has_alpha && values.raw(first + samples - 1) == 0) continue;
    if (transparent) {
      bool is_equal = true;
      for (size_t i = 0; i < samples; ++i) {
        is_equal = is_equal && values.raw(first + i) == (*transparent)[i];
      }
      if (is_equal) continue;
    }
    PaletteColor color{};
    for (size_t c = 0; c < color.size(); ++c) color[c] = values.byte(first + (is_gray ? 0 : c));
    if (color == last) continue;
    last = color;
    VOXELD_TRY(colors.add(color));
  }
  return {};
}

Status add_pixels(const Chunks& chunks, FileColors& colors) {
  const Header& header = chunks.header;
  Inflater inflater(chunks.data);
  if (!inflater.open()) return colors.error("", "memory to inflate an image", "none");
  std::vector<uint8_t> above(header.row_bytes()), filtered(header.row_bytes() + 1);
  for (uint32_t y = 0; y < header.height; ++y) {
    const std::string place = "row " + std::to_string(y);
    if (!inflater.fill(filtered)) {
      return colors.error(place, "the pixels of " + std::to_string(header.height) + " rows",
                          "compressed data that is broken or ends");
    }
    const std::span<uint8_t> row = std::span(filtered).subspan(1);
    if (!unfilter(filtered[0], row, above, header.step())) {
      return colors.error(place, "a filter from 0 to 4", std::to_string(filtered[0]));
    }
    VOXELD_TRY(add_row(chunks, row, colors));
    std::ranges::copy(row, above.begin());
  }
  return {};
}

}  // namespace

Status read_png(Bytes bytes, FileColors& colors) {
  VOXELD_ASSIGN(const Chunks chunks, read_chunks(bytes, colors));
  return chunks.header.type == kIndexed ? add_entries(chunks, colors) : add_pixels(chunks, colors);
}

}  // namespace voxeld::palette_files
