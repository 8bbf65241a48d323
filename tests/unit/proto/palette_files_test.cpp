// Palette files that are read, and the exact errors of those that are not.
#include "proto/palette_files/palette_files.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <bit>
#include <string>

namespace voxeld {
namespace {

using Colors = std::vector<PaletteColor>;

std::span<const uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

Colors read(const std::string& file, std::string_view name) {
  const auto colors = read_palette(bytes_of(file), name);
  EXPECT_TRUE(colors) << (colors ? "" : colors.error().message());
  return colors ? *colors : Colors();
}

std::string error_of(const std::string& file, std::string_view name) {
  const auto colors = read_palette(bytes_of(file), name);
  EXPECT_FALSE(colors) << name;
  if (colors) return "";
  EXPECT_EQ(colors.error().code, ErrorCode::kInvalidOption);
  return colors.error().message();
}

// Every proper beginning of the file is refused, or has the file's colours; the last number of a
// text may be cut.
void expect_cut_files_are_harmless(const std::string& file, std::string_view name) {
  const size_t count = read(file, name).size();
  for (size_t length = 0; length < file.size(); ++length) {
    const auto colors = read_palette(bytes_of(file.substr(0, length)), name);
    if (colors) {
      EXPECT_LE(colors->size(), count + 1) << name << " " << length;
    }
  }
}

// A number in `size` bytes.
std::string big(uint64_t value, int size) {
  std::string text;
  for (int i = size - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i) & 255);
  return text;
}
std::string little(uint64_t value, int size) {
  std::string text;
  for (int i = 0; i < size; ++i) text += static_cast<char>(value >> (8 * i) & 255);
  return text;
}
std::string real(float value) {
  return big(std::bit_cast<uint32_t>(value), 4);
}

TEST(GimpPalette, has_colours_with_and_without_names) {
  const std::string file =
      "GIMP Palette\r\nName: a\r\nColumns: 4\r\n# c\r\n\r\n 26  28 44\tblack\r\n255 255 255\r\n"
      "26 28 44 again\r\n";
  EXPECT_EQ(read(file, "a.gpl"), (Colors{{26, 28, 44}, {255, 255, 255}}));
  EXPECT_EQ(read("GIMP Palette\n1 2 3", "any name"), (Colors{{1, 2, 3}}));
  expect_cut_files_are_harmless(file, "a.gpl");
}

TEST(GimpPalette, with_alpha_has_the_colours_above_alpha_0) {
  const std::string colors = "#\n1 2 3 255 a\n4 5 6 0 Mask\n7 8 9 128\n";
  EXPECT_EQ(read("GIMP Palette\nChannels: RGBA\n" + colors, "a.gpl"),
            (Colors{{1, 2, 3}, {7, 8, 9}}));
  // Without that line a fourth number is a name.
  EXPECT_EQ(read("GIMP Palette\n" + colors, "a.gpl"), (Colors{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}));
  EXPECT_EQ(error_of("GIMP Palette\nChannels: CMYK\n" + colors, "a.gpl"),
            "a.gpl line 2: expected red, green and blue from 0 to 255, got \"Channels: CMYK\"");
}

TEST(GimpPalette, tells_the_line_that_is_wrong) {
  EXPECT_EQ(error_of("GIMP Palette\n1 2 3\n1 2 256 x\n", "a.gpl"),
            "a.gpl line 3: expected red, green and blue from 0 to 255, got \"1 2 256 x\"");
  EXPECT_EQ(error_of("GIMP Palette\n1 2\n", "a.gpl"),
            "a.gpl line 2: expected red, green and blue from 0 to 255, got \"1 2\"");
  EXPECT_EQ(error_of("GIMP Palette\n1 2 3\nName: x\n", "a.gpl"),
            "a.gpl line 3: expected red, green and blue from 0 to 255, got \"Name: x\"");
  EXPECT_EQ(error_of("GIMP Palette 2\n", "a.gpl"),
            "a.gpl line 1: expected GIMP Palette, got \"GIMP Palette 2\"");
  EXPECT_EQ(error_of("GIMP Palette\n# nothing\n", "a.gpl"),
            "a.gpl: expected at least one colour, got none");
  EXPECT_EQ(error_of("Gimp\n1 2 3\n", "a.GPL"),
            "a.GPL: expected a file that begins with \"GIMP Palette\", got \"Gimp?1 2 3?\"");
}

TEST(JascPalette, has_as_many_colours_as_it_says) {
  const std::string file = "JASC-PAL\r\n0100\r\n2\r\n0 0 0\r\n255 128 0\r\n";
  EXPECT_EQ(read(file, "a.pal"), (Colors{{0, 0, 0}, {255, 128, 0}}));
  expect_cut_files_are_harmless(file, "a.pal");
  EXPECT_EQ(error_of("JASC-PAL\n0200\n1\n0 0 0\n", "a.pal"),
            "a.pal line 2: expected 0100, got \"0200\"");
  EXPECT_EQ(error_of("JASC-PAL\n0100\nx\n", "a.pal"),
            "a.pal line 3: expected the number of colours, got \"x\"");
  EXPECT_EQ(error_of("JASC-PAL\n0100\n2\n0 0 0\n", "a.pal"),
            "a.pal: expected the 2 colours of line 3, got 1");
  EXPECT_EQ(error_of("JASC-PAL\n0100\n1\n0 0 0\n0 0 0\n", "a.pal"),
            "a.pal line 5: expected the 1 colours of line 3, got more");
  EXPECT_EQ(error_of("JASC-PAL\n0100\n1\n0 0 0 0\n", "a.pal"),
            "a.pal line 4: expected red, green and blue from 0 to 255, got \"0 0 0 0\"");
  EXPECT_EQ(error_of("PAL", "a.pal"),
            "a.pal: expected a file that begins with 'JASC-PAL' or 'RIFF', got \"PAL\"");
}

TEST(PaletteFiles, of_text_may_have_a_byte_order_mark) {
  const std::string utf8 = "\xef\xbb\xbf", gimp = "GIMP Palette\r\n1 2 3\r\n";
  EXPECT_EQ(read(utf8 + gimp, "a.gpl"), (Colors{{1, 2, 3}}));
  EXPECT_EQ(read(utf8 + "JASC-PAL\r\n0100\r\n1\r\n1 2 3\r\n", "a.pal"), (Colors{{1, 2, 3}}));
  std::string utf16 = "\xff\xfe";
  for (const char c : gimp) utf16 += little(static_cast<uint64_t>(c), 2);
  EXPECT_EQ(read(utf16, "a.gpl"), (Colors{{1, 2, 3}}));
}

TEST(HexPalette, has_a_colour_in_each_line) {
  EXPECT_EQ(read("1a1c2c\r\n\r\n#F4F4f4\r\n", "a.hex"), (Colors{{26, 28, 44}, {244, 244, 244}}));
  EXPECT_EQ(error_of("1a1c2c\n1a1c2\n", "a.hex"),
            "a.hex line 2: expected six hexadecimal digits, got \"1a1c2\"");
  EXPECT_EQ(error_of("+a1c2c\n", "a.hex"),
            "a.hex line 1: expected six hexadecimal digits, got \"+a1c2c\"");
  std::string many;
  for (int i = 0; i < 257; ++i)
    many += "00" + std::string(i < 256 ? "00" : "01") + "0123456789abcdef"[i >> 4 & 15] +
            std::string(1, "0123456789abcdef"[i & 15]) + "\n";
  EXPECT_EQ(error_of(many, "a.hex"), "a.hex: expected at most 256 colours, got more");
}

TEST(RiffPalette, skips_other_chunks) {
  const std::string data =
      little(0x300, 2) + little(2, 2) + "\x01\x02\x03" + '\0' + "\xff\xfe\xfd" + '\0';
  const std::string file = "RIFF" + little(100, 4) + "PAL " + "note" + little(3, 4) + "abc" + '\0' +
                           "data" + little(data.size(), 4) + data;
  EXPECT_EQ(read(file, "a.pal"), (Colors{{1, 2, 3}, {255, 254, 253}}));
  expect_cut_files_are_harmless(file, "a.pal");
  EXPECT_EQ(error_of("RIFF" + little(4, 4) + "WAVE", "a.pal"),
            "a.pal byte 8: expected the form 'PAL ', got \"WAVE\"");
  EXPECT_EQ(error_of("RIFF" + little(4, 4) + "PAL ", "a.pal"),
            "a.pal byte 12: expected a chunk 'data', got the end");
  EXPECT_EQ(error_of("RIFF" + little(4, 4) + "PAL data" + little(4, 4) + little(2, 4), "a.pal"),
            "a.pal byte 20: expected version 768, got 2");
  EXPECT_EQ(error_of(file.substr(0, file.size() - 1), "a.pal"),
            "a.pal byte 40: expected a colour of 4 bytes, got 3 bytes until the end");
}

TEST(ColorTable, has_all_colours_or_as_many_as_it_says) {
  std::string table;
  for (int i = 0; i < 256; ++i) table += {static_cast<char>(i), '\x07', '\x09'};
  EXPECT_EQ(read(table, "a.ACT").size(), 256u);
  EXPECT_EQ(read(table + big(3, 2) + big(0xffff, 2), "a.act"),
            (Colors{{0, 7, 9}, {1, 7, 9}, {2, 7, 9}}));
  EXPECT_EQ(read(table + big(3, 2) + big(1, 2), "a.act"), (Colors{{0, 7, 9}, {2, 7, 9}}));
  EXPECT_EQ(error_of(table + "x", "a.act"), "a.act: expected 768 or 772 bytes, got 769");
  EXPECT_EQ(error_of(table + big(0, 4), "a.act"),
            "a.act byte 768: expected a number of colours from 1 to 256, got 0");
}

TEST(ColorSwatches, of_both_versions_are_read) {
  const std::string red = big(0, 2) + big(0xffff, 2) + big(0, 2) + big(0x8080, 2) + big(0, 2);
  const std::string gray = big(8, 2) + big(5000, 2) + big(0, 6);
  const std::string first = big(1, 2) + big(2, 2) + red + gray;
  const std::string second =
      big(2, 2) + big(2, 2) + red + big(2, 4) + big(0x6100, 4) + gray + big(0, 4);
  const Colors colors = {{255, 0, 128}, {128, 128, 128}};
  EXPECT_EQ(read(first, "a.aco"), colors);
  EXPECT_EQ(read(second, "a.aco"), colors);
  EXPECT_EQ(read(first + second, "a.aco"), colors);
  expect_cut_files_are_harmless(first, "a.aco");
  EXPECT_EQ(error_of(big(3, 2), "a.aco"), "a.aco byte 0: expected version 1 or 2, got 3");
  EXPECT_EQ(error_of(big(1, 2) + big(1, 2) + big(2, 2) + big(0, 8), "a.aco"),
            "a.aco byte 4: expected a colour in RGB or grey, got CMYK");
  EXPECT_EQ(error_of(big(1, 2) + big(1, 2) + big(8, 2) + big(10001, 2) + big(0, 6), "a.aco"),
            "a.aco byte 4: expected a grey from 0 to 10000, got 10001");
  EXPECT_EQ(error_of(first + big(7, 2), "a.aco"),
            "a.aco byte 24: expected the end, or version 2 of the colours, got 7");
  EXPECT_EQ(error_of(big(1, 2) + big(9, 2) + red, "a.aco"),
            "a.aco byte 14: expected a colour's space of 2 bytes, got 0 bytes until the end");
}

std::string swatch_block(const std::string& model_and_values) {
  const std::string data = big(2, 2) + big(0x41, 2) + big(0, 2) + model_and_values + big(2, 2);
  return big(1, 2) + big(data.size(), 4) + data;
}

TEST(SwatchExchange, has_colours_in_groups) {
  const std::string group = big(0xc001, 2) + big(4, 4) + big(1, 2) + big(0, 2);
  const std::string file = "ASEF" + big(1, 2) + big(0, 2) + big(4, 4) + group +
                           swatch_block("RGB " + real(1) + real(0.5f) + real(0)) +
                           swatch_block("Gray" + real(0.25f)) + big(0xc002, 2) + big(0, 4);
  EXPECT_EQ(read(file, "a.ase"), (Colors{{255, 128, 0}, {64, 64, 64}}));
  expect_cut_files_are_harmless(file, "a.ase");
  const std::string head = "ASEF" + big(1, 2) + big(0, 2) + big(1, 4);
  EXPECT_EQ(error_of(head + swatch_block("CMYK" + real(0) + real(0) + real(0) + real(0)), "a.ase"),
            "a.ase byte 24: expected a colour of model 'RGB ' or 'Gray', got \"CMYK\"");
  EXPECT_EQ(error_of("ASEF" + big(2, 2) + big(0, 2), "a.ase"),
            "a.ase byte 4: expected version 1, got 2.0");
  EXPECT_EQ(error_of(head + big(1, 2) + big(9, 4), "a.ase"),
            "a.ase byte 18: expected a block of 9 bytes, got 0 bytes until the end");
  EXPECT_EQ(error_of("\x9c\x01", "a.ase"),
            "a.ase: expected a file that begins with \"ASEF\", got \"??\"");
}

std::string chunk(const std::string& id, const std::string& data) {
  const std::string summed = id + data;
  const auto sum =
      crc32(0, reinterpret_cast<const Bytef*>(summed.data()), static_cast<uInt>(summed.size()));
  return big(data.size(), 4) + summed + big(sum, 4);
}

std::string deflated(const std::string& data) {
  std::string out(compressBound(data.size()), '\0');
  uLongf size = out.size();
  compress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(data.data()),
           data.size());
  return out.substr(0, size);
}

const std::string kSignature = "\x89PNG\r\n\x1a\n";

std::string header(int width, int height, int depth, int type, int interlace = 0) {
  return chunk("IHDR",
               big(static_cast<uint64_t>(width), 4) + big(static_cast<uint64_t>(height), 4) +
                   big(static_cast<uint64_t>(depth), 1) + big(static_cast<uint64_t>(type), 1) +
                   big(0, 2) + big(static_cast<uint64_t>(interlace), 1));
}

std::string image(const std::string& head, const std::string& rows) {
  return kSignature + head + chunk("IDAT", deflated(rows)) + chunk("IEND", "");
}

TEST(PngPalette, of_an_indexed_image_has_its_entries_in_order) {
  const std::string file = kSignature + header(1, 1, 8, 3) +
                           chunk("PLTE", std::string("\x09\x08\x07\x01\x02\x03\x04\x05\x06", 9)) +
                           chunk("tRNS", std::string("\xff\x00", 2)) +
                           chunk("IDAT", deflated(std::string(2, '\0'))) + chunk("IEND", "");
  EXPECT_EQ(read(file, "a.png"), (Colors{{9, 8, 7}, {4, 5, 6}}));
  expect_cut_files_are_harmless(file, "a.png");
}

TEST(PngPalette, of_another_image_has_its_colours_by_rows) {
  // Each filter once: two pixels a row, RGB; the rows are all 10,20,30 and 11,22,33.
  const std::string none("\x00\x0a\x14\x1e\x0b\x16\x21", 7),
      left("\x01\x0a\x14\x1e\x01\x02\x03", 7), above("\x02\x00\x00\x00\x00\x00\x00", 7),
      average("\x03\x05\x0a\x0f\x01\x01\x02", 7), paeth("\x04\x00\x00\x00\x00\x00\x00", 7);
  const Colors two = {{10, 20, 30}, {11, 22, 33}};
  EXPECT_EQ(read(image(header(2, 5, 8, 2), none + left + above + average + paeth), "a.png"), two);
  // Alpha 0 is no colour.
  EXPECT_EQ(read(image(header(2, 1, 8, 6), std::string("\0\1\2\3\0\4\5\6\1", 9)), "a.png"),
            (Colors{{4, 5, 6}}));
  // Two bits of grey: 0, 1, 2, 3.
  EXPECT_EQ(read(image(header(4, 1, 2, 0), std::string("\0\x1b", 2)), "a.png"),
            (Colors{{0, 0, 0}, {85, 85, 85}, {170, 170, 170}, {255, 255, 255}}));
  // 16 bits of grey.
  EXPECT_EQ(read(image(header(1, 1, 16, 0), std::string("\0\x80\x80", 3)), "a.png"),
            (Colors{{128, 128, 128}}));
  // tRNS of a grey.
  EXPECT_EQ(read(image(header(2, 1, 8, 0) + chunk("tRNS", std::string("\0\5", 2)),
                       std::string("\0\5\6", 3)),
                 "a.png"),
            (Colors{{6, 6, 6}}));
}

TEST(PngPalette, tells_what_is_wrong) {
  const std::string pixel("\0\1\2\3", 4);
  EXPECT_EQ(error_of(image(header(1, 1, 8, 2, 1), pixel), "a.png"),
            "a.png byte 8: expected an image that is not interlaced, got interlacing");
  EXPECT_EQ(error_of(image(header(1, 1, 4, 2), pixel), "a.png"),
            "a.png byte 8: expected a colour type and depth of PNG, got type 2 with 4 bits");
  EXPECT_EQ(error_of(image(header(4096, 257, 8, 2), pixel), "a.png"),
            "a.png byte 8: expected an image of 1 to 1048576 pixels, got 4096 x 257");
  EXPECT_EQ(
      error_of(image(header(1, 2, 8, 2), pixel), "a.png"),
      "a.png row 1: expected the pixels of 2 rows, got compressed data that is broken or ends");
  EXPECT_EQ(error_of(image(header(1, 1, 8, 2), "\x05" + pixel.substr(1)), "a.png"),
            "a.png row 0: expected a filter from 0 to 4, got 5");
  std::string wrong_sum = image(header(1, 1, 8, 2), pixel);
  wrong_sum[20] ^= 1;
  EXPECT_EQ(error_of(wrong_sum, "a.png"),
            "a.png byte 8: expected a chunk with the right checksum, got a wrong one of \"IHDR\"");
  EXPECT_EQ(error_of(kSignature + chunk("IEND", ""), "a.png"),
            "a.png byte 8: expected a chunk 'IHDR', got \"IEND\"");
  EXPECT_EQ(error_of(kSignature + header(1, 1, 8, 3) + chunk("IEND", ""), "a.png"),
            "a.png chunk PLTE: expected 1 to 256 colours of 3 bytes, got 0 bytes");
  EXPECT_EQ(error_of("GIF89a", "a.png"), "a.png: expected a PNG image, got \"GIF89a\"");
}

TEST(PaletteFiles, of_other_formats_and_sizes_are_refused) {
  EXPECT_EQ(error_of("x", "a.txt"),
            "a.txt: expected a palette: .gpl .pal .act .aco .ase .hex .png, got another file");
  EXPECT_EQ(error_of(std::string(kPaletteFileBytesMax + 1, 'x'), "a.gpl"),
            "a.gpl: expected at most 4194304 bytes, got 4194305");
  EXPECT_EQ(error_of("", "a.hex"), "a.hex: expected at least one colour, got none");
}

}  // namespace
}  // namespace voxeld
