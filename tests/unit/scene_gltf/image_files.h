// Small image files, written by the formats' own libraries or byte by byte.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/scene/images/decoders.h"

namespace voxeld {

using Bytes = std::vector<uint8_t>;

// Bytes that look random, the same in each run.
Bytes noise(size_t count, uint32_t seed = 1);

struct PngKind {
  int color_type = 6;  // of the PNG specification: 0 grey, 2 RGB, 3 palette, 4 grey + alpha, 6 RGBA
  int depth = 8;
  bool is_interlaced = false;
  bool has_transparency = false;  // a tRNS chunk
};
// A PNG of noise.
Bytes png_of(const PngKind& kind, int width, int height);

struct JpegKind {
  int channel_count = 3;
  bool is_progressive = false;
};
// A JPEG of a gradient, of quality 95.
Bytes jpeg_of(const JpegKind& kind, int width, int height);

struct TiffKind {
  int channel_count = 3;
  int bits = 8;
  int compression = 1;  // COMPRESSION_NONE
  bool is_tiled = false;
  bool is_big_endian = false;
  bool is_multiplied = false;  // colours by alpha
};
// A TIFF of these samples, row by row; without them, of noise.
Bytes tiff_of(const TiffKind& kind, int width, int height, Bytes samples = {});

// A lossless WebP.
Bytes webp_of(const Bytes& rgba, int width);

struct GifKind {
  bool is_interlaced = false;
  int transparent = -1;
  int left = 0, top = 0;  // of the frame
  int screen_width = 0, screen_height = 0;
};
// A GIF of the indices, with the palette (i, 2 i, 255 - i).
Bytes gif_of(const GifKind& kind, const Bytes& indices, int width);

// A BMP whose pixels are these bytes; palette: four bytes an entry. With a negative height, rows
// begin at the top.
Bytes bmp_of(int bits, int width, int height, const Bytes& pixels, const Bytes& palette = {});

Bytes hdr_of(const std::string& size, const Bytes& pixels);

struct DdsKind {
  uint32_t width = 4, height = 4;
  std::string letters = {};  // four, or empty for masks
  uint32_t flags = 0;        // besides that of letters
  uint32_t bits = 0;
  std::vector<uint32_t> masks = {0, 0, 0, 0};
  uint32_t dxgi = 0, dimension = 3;  // after DX10
};
Bytes dds_of(const DdsKind& kind, const Bytes& pixels);

// One good file of each format.
struct SampleFile {
  std::string name;
  Bytes bytes;
  size_t pixel_count = 0;
  ImageDecoder* decode = nullptr;
};
std::vector<SampleFile> sample_files();

// The pixels that decode_image() reads from a file. A file that it refuses fails the test.
Bytes pixels(const Bytes& file);

}  // namespace voxeld
