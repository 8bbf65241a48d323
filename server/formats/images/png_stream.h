// PNG images written from rows that all threads deflate, of any height: only the compressed bytes
// are in memory.
//
//   89 50 4e 47 0d 0a 1a 0a
//   IHDR  width, height, bits of a sample, colour type; not interlaced
//   sRGB  of colours
//   pHYs  pixels per metre, where the units are known
//   IDAT  one for each part of the rows: together one zlib stream, each row behind its filter byte
//   IEND
//
// The specification: https://www.w3.org/TR/png-3/
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "server/formats/zip/deflate_pieces.h"

namespace voxeld::images {

enum class PngColor : uint8_t { kGrey = 0, kRgb = 2, kRgba = 6 };

// Samples of 16 bits are big-endian.
struct PngPixel {
  PngColor color;
  uint8_t sample_bits;  // 8 or 16
  size_t bytes;
};

struct PngHeader {
  uint32_t width, height;  // 1 to 2^31 - 1
  PngPixel pixel;
  std::array<uint32_t, 2> pixels_per_metre{};  // along x and y; a 0: unknown
};

// The differences that rows are stored as.
enum class PngFilter {
  kNone,  // for cells that are mostly empty: their runs of zeros stay
  kUp     // to the row above, for values that change slowly; the first row is as it is
};

// A part of an image: rows of one byte of any value, which becomes that of the filter, and
// row_bytes bytes of pixels, which become differences. At most Deflater::kBlockBytesMax bytes.
// Thread-safe.
DeflatedPiece png_rows(std::span<uint8_t> rows, size_t row_bytes, PngFilter filter);

class PngStream {
 public:
  explicit PngStream(const PngHeader& header);
  // Adds the next rows.
  void add(const DeflatedPiece& rows);
  // Ends the image; the last call.
  std::vector<uint8_t> finish();

 private:
  void add_chunk(std::string_view type, std::span<const std::span<const uint8_t>> parts);

  std::vector<uint8_t> bytes_;
  uint32_t adler_;
  bool has_rows_ = false;
};

}  // namespace voxeld::images
