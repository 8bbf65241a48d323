#include "tests/unit/scene_gltf/image_files.h"

#include <gif_lib.h>
#include <gtest/gtest.h>
#include <png.h>
#include <tiffio.h>
#include <webp/encode.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
//
#include <jpeglib.h>

#include "server/base/check.h"
#include "server/base/disk/file.h"
#include "server/scene/images/image.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

void put(Bytes& out, uint64_t value, size_t count) {
  for (size_t i = 0; i < count; ++i) out.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

void append(Bytes& out, const Bytes& more) {
  out.insert(out.end(), more.begin(), more.end());
}

void set_transparency(png_structp png, png_infop info, const PngKind& kind) {
  if (kind.color_type == PNG_COLOR_TYPE_PALETTE) {
    const Bytes alpha = noise(size_t{1} << (kind.depth - 1), 7);
    png_set_tRNS(png, info, alpha.data(), static_cast<int>(alpha.size()), nullptr);
    return;
  }
  png_color_16 key{};
  key.gray = static_cast<png_uint_16>(kind.depth < 8 ? 1 : 0x55);
  key.red = key.green = key.blue = 0x55;
  png_set_tRNS(png, info, nullptr, 1, &key);
}

}  // namespace

Bytes noise(size_t count, uint32_t seed) {
  Bytes bytes(count);
  for (uint8_t& byte : bytes) {
    seed = seed * 1664525u + 1013904223u;
    byte = static_cast<uint8_t>(seed >> 24);
  }
  return bytes;
}

Bytes png_of(const PngKind& kind, int width, int height) {
  Bytes out;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(
      png, &out,
      [](png_structp writer, png_bytep data, size_t count) {
        auto& to = *static_cast<Bytes*>(png_get_io_ptr(writer));
        to.insert(to.end(), data, data + count);
      },
      nullptr);
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height),
               kind.depth, kind.color_type,
               kind.is_interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, 0, 0);
  if (kind.color_type == PNG_COLOR_TYPE_PALETTE) {
    const Bytes colors = noise(size_t{3} << kind.depth, 5);
    png_set_PLTE(png, info, reinterpret_cast<png_const_colorp>(colors.data()), 1 << kind.depth);
  }
  if (kind.has_transparency) set_transparency(png, info, kind);
  png_write_info(png, info);
  const size_t row_bytes = png_get_rowbytes(png, info);
  Bytes pixels = noise(row_bytes * static_cast<size_t>(height));
  if (kind.has_transparency && kind.depth == 8) std::fill_n(pixels.begin(), 6, uint8_t{0x55});
  std::vector<png_bytep> rows;
  for (int y = 0; y < height; ++y) rows.push_back(&pixels[row_bytes * static_cast<size_t>(y)]);
  png_write_image(png, rows.data());
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  return out;
}

Bytes jpeg_of(const JpegKind& kind, int width, int height) {
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  unsigned char* data = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&jpeg, &data, &size);
  jpeg.image_width = static_cast<JDIMENSION>(width);
  jpeg.image_height = static_cast<JDIMENSION>(height);
  jpeg.input_components = kind.channel_count;
  jpeg.in_color_space = kind.channel_count == 1   ? JCS_GRAYSCALE
                        : kind.channel_count == 3 ? JCS_RGB
                                                  : JCS_CMYK;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, 95, TRUE);
  if (kind.is_progressive) jpeg_simple_progression(&jpeg);
  jpeg_start_compress(&jpeg, TRUE);
  Bytes row(static_cast<size_t>(width * kind.channel_count));
  for (int y = 0; y < height; ++y) {
    for (size_t i = 0; i < row.size(); ++i) {
      const size_t x = i / static_cast<size_t>(kind.channel_count);
      row[i] = static_cast<uint8_t>(60 + 3 * x + 5 * static_cast<size_t>(y) +
                                    40 * (i % static_cast<size_t>(kind.channel_count)));
    }
    JSAMPROW at = row.data();
    jpeg_write_scanlines(&jpeg, &at, 1);
  }
  jpeg_finish_compress(&jpeg);
  Bytes out(data, data + size);
  jpeg_destroy_compress(&jpeg);
  std::free(data);
  return out;
}

Bytes tiff_of(const TiffKind& kind, int width, int height, Bytes samples) {
  const testing::TemporaryDir dir;
  const std::string path = (dir.path() / "a.tif").string();
  TIFF* tiff = TIFFOpen(path.c_str(), kind.is_big_endian ? "wb" : "wl");
  VOXELD_CHECK(tiff != nullptr, "a new TIFF");
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, width);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, height);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, kind.channel_count);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, kind.bits);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, kind.compression);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC,
               kind.channel_count < 3 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB);
  if (kind.channel_count % 2 == 0) {
    const uint16_t alpha = kind.is_multiplied ? EXTRASAMPLE_ASSOCALPHA : EXTRASAMPLE_UNASSALPHA;
    TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, 1, &alpha);
  }
  const size_t pixel_bytes = static_cast<size_t>(kind.channel_count * kind.bits / 8);
  const size_t row_bytes = pixel_bytes * static_cast<size_t>(width);
  if (samples.empty()) samples = noise(row_bytes * static_cast<size_t>(height));
  if (kind.is_tiled) {
    constexpr int kTileSide = 16;
    TIFFSetField(tiff, TIFFTAG_TILEWIDTH, kTileSide);
    TIFFSetField(tiff, TIFFTAG_TILELENGTH, kTileSide);
    for (int top = 0; top < height; top += kTileSide) {
      for (int left = 0; left < width; left += kTileSide) {
        Bytes tile(pixel_bytes * kTileSide * kTileSide);
        const size_t bytes = pixel_bytes * static_cast<size_t>(std::min(kTileSide, width - left));
        for (int y = 0; y < std::min(kTileSide, height - top); ++y) {
          std::memcpy(&tile[pixel_bytes * static_cast<size_t>(kTileSide * y)],
                      &samples[row_bytes * static_cast<size_t>(top + y) +
                               pixel_bytes * static_cast<size_t>(left)],
                      bytes);
        }
        TIFFWriteTile(tiff, tile.data(), static_cast<uint32_t>(left), static_cast<uint32_t>(top), 0,
                      0);
      }
    }
  } else {
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 3);
    for (int y = 0; y < height; ++y) {
      TIFFWriteScanline(tiff, &samples[row_bytes * static_cast<size_t>(y)],
                        static_cast<uint32_t>(y), 0);
    }
  }
  TIFFClose(tiff);
  return read_file(path).value();
}

Bytes webp_of(const Bytes& rgba, int width) {
  uint8_t* data = nullptr;
  const int height = static_cast<int>(rgba.size()) / 4 / width;
  const size_t size = WebPEncodeLosslessRGBA(rgba.data(), width, height, 4 * width, &data);
  Bytes out(data, data + size);
  WebPFree(data);
  return out;
}

Bytes gif_of(const GifKind& kind, const Bytes& indices, int width) {
  Bytes out;
  int code = 0;
  GifFileType* gif = EGifOpen(
      &out,
      [](GifFileType* writer, const GifByteType* data, int count) {
        auto& to = *static_cast<Bytes*>(writer->UserData);
        to.insert(to.end(), data, data + count);
        return count;
      },
      &code);
  VOXELD_CHECK(gif != nullptr, "a new GIF");
  const int height = static_cast<int>(indices.size()) / width;
  ColorMapObject* colors = GifMakeMapObject(256, nullptr);
  for (int i = 0; i < 256; ++i) {
    colors->Colors[i] = {static_cast<uint8_t>(i), static_cast<uint8_t>(2 * i),
                         static_cast<uint8_t>(255 - i)};
  }
  EGifSetGifVersion(gif, true);
  EGifPutScreenDesc(gif, std::max(kind.screen_width, width), std::max(kind.screen_height, height),
                    8, 0, colors);
  const GraphicsControlBlock control{0, false, 0, kind.transparent};
  GifByteType bytes[4] = {};
  EGifGCBToExtension(&control, bytes);
  EGifPutExtension(gif, GRAPHICS_EXT_FUNC_CODE, 4, bytes);
  EGifPutImageDesc(gif, kind.left, kind.top, width, height, kind.is_interlaced, nullptr);
  // giflib expects interlaced rows in the file's order.
  const auto put_rows = [&](int first, int step) {
    for (int y = first; y < height; y += step) {
      Bytes row(indices.begin() + y * width, indices.begin() + (y + 1) * width);
      EGifPutLine(gif, row.data(), width);
    }
  };
  if (kind.is_interlaced) {
    put_rows(0, 8);
    put_rows(4, 8);
    put_rows(2, 4);
    put_rows(1, 2);
  } else {
    put_rows(0, 1);
  }
  EGifCloseFile(gif, &code);
  GifFreeMapObject(colors);
  return out;
}

Bytes bmp_of(int bits, int width, int height, const Bytes& pixels, const Bytes& palette) {
  Bytes out = {'B', 'M'};
  put(out, 54 + palette.size() + pixels.size(), 4);
  put(out, 0, 4);
  put(out, 54 + palette.size(), 4);
  put(out, 40, 4);
  put(out, static_cast<uint32_t>(width), 4);
  put(out, static_cast<uint32_t>(height), 4);
  put(out, 1, 2);
  put(out, static_cast<uint32_t>(bits), 2);
  out.resize(out.size() + 16);
  put(out, palette.size() / 4, 4);
  put(out, 0, 4);
  append(out, palette);
  append(out, pixels);
  return out;
}

Bytes hdr_of(const std::string& size, const Bytes& pixels) {
  const std::string head = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + size + "\n";
  Bytes out(head.begin(), head.end());
  append(out, pixels);
  return out;
}

Bytes dds_of(const DdsKind& kind, const Bytes& pixels) {
  Bytes out = {'D', 'D', 'S', ' '};
  put(out, 124, 4);
  put(out, 0x1007, 4);
  put(out, kind.height, 4);
  put(out, kind.width, 4);
  out.resize(76);
  put(out, 32, 4);
  put(out, kind.flags | (kind.letters.empty() ? 0u : 4u), 4);
  out.insert(out.end(), kind.letters.begin(), kind.letters.end());
  out.resize(88);
  put(out, kind.bits, 4);
  for (const uint32_t mask : kind.masks) put(out, mask, 4);
  put(out, 0x1000, 4);
  out.resize(128);
  if (kind.letters == "DX10") {
    put(out, kind.dxgi, 4);
    put(out, kind.dimension, 4);
    out.resize(148);
  }
  append(out, pixels);
  return out;
}

std::vector<SampleFile> sample_files() {
  const Bytes runs = {2, 2, 0, 8, 136, 128, 136, 64, 8, 1, 2, 3, 4, 5, 6, 7, 8, 136, 128};
  return {
      {"png", png_of({.color_type = 3}, 9, 7), 63, decode_png},
      {"interlaced png", png_of({.color_type = 6, .depth = 16, .is_interlaced = true}, 9, 7), 63,
       decode_png},
      {"jpeg", jpeg_of({}, 24, 20), 480, decode_jpeg},
      {"progressive jpeg", jpeg_of({.is_progressive = true}, 24, 20), 480, decode_jpeg},
      {"webp", webp_of(noise(4 * 63), 9), 63, decode_webp},
      {"tiff", tiff_of({.channel_count = 4}, 9, 7), 63, decode_tiff},
      {"tiled tiff", tiff_of({.compression = COMPRESSION_LZW, .is_tiled = true}, 20, 18), 360,
       decode_tiff},
      {"gif", gif_of({}, noise(63), 9), 63, decode_gif},
      {"bmp", bmp_of(24, 3, 2, noise(24)), 6, decode_bmp},
      {"hdr", hdr_of("-Y 1 +X 8", runs), 8, decode_hdr},
      {"dds", dds_of({.letters = "DXT5"}, noise(16)), 16, decode_dds},
      {"dds of masks",
       dds_of({.flags = 0x40, .bits = 24, .masks = {255, 0xff00, 0xff0000, 0}}, noise(48)), 16,
       decode_dds},
  };
}

Bytes pixels(const Bytes& file) {
  const auto image = decode_image("a", file);
  EXPECT_TRUE(image.ok()) << (image ? "" : image.error().message());
  return image ? image->rgba : Bytes();
}

}  // namespace voxeld
