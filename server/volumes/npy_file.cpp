// Reads NumPy's .npy, versions 1.0, 2.0 and 3.0:
//
//   byte  size  content
//      0     6  magic: 0x93 "NUMPY"
//      6     2  u8 major version, u8 minor version 0
//      8     2  version 1: u16 header bytes, little-endian; later ones: u32, 4 bytes
//             n  header: a Python dictionary with 'descr', 'fortran_order' and 'shape'
//                samples without gaps; the last axis is the fastest one, or in Fortran order the
//                first
//
// Axes are z, y, x, so an array of our own in axis order xyz comes out with x and z exchanged: the
// header does not tell them apart. The specification:
// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/text/number_text.h"
#include "server/volumes/dense_samples.h"
#include "server/volumes/header_text.h"
#include "server/volumes/volume_error.h"
#include "server/volumes/volume_files.h"

namespace voxeld::volumes {
namespace {

constexpr size_t kNpyPreambleBytes = 8;
constexpr size_t kNpyAxesMax = 32;  // NumPy's own limit

struct NpyHeader {
  std::optional<std::string_view> descr;
  std::optional<bool> is_fortran;
  std::optional<std::vector<uint64_t>> shape;
};

// Parses the dictionary of a header: a small part of Python.
class NpyDictionary {
 public:
  NpyDictionary(std::string_view name, std::string_view text) : name_(name), text_(text) {}

  Result<NpyHeader> read() {
    NpyHeader header;
    if (!take('{')) return broken("'{'");
    while (!take('}')) {
      const auto key = text();
      if (!key) return broken("a key in quotes or '}'");
      if (!take(':')) return broken("':'");
      VOXELD_TRY(read_value(*key, header));
      if (take(',')) continue;
      if (!take('}')) return broken("',' or '}'");
      break;
    }
    skip_blanks();
    if (at_ != text_.size()) return broken("the end of the header");
    if (header.descr && header.is_fortran && header.shape) return header;
    return malformed_volume(name_, "header", "a key is missing", "descr, fortran_order and shape",
                            std::string(header.descr ? "descr " : "") +
                                (header.is_fortran ? "fortran_order " : "") +
                                (header.shape ? "shape" : ""));
  }

 private:
  Status read_value(std::string_view key, NpyHeader& header) {
    const bool is_again = (key == "descr" && header.descr) ||
                          (key == "fortran_order" && header.is_fortran) ||
                          (key == "shape" && header.shape);
    if (is_again)
      return malformed_volume(name_, "header", "a key is there twice", "", shown_text(key));
    if (key == "descr") {
      skip_blanks();
      if (text_.substr(at_).starts_with('[')) {
        return unsupported_volume(name_, "descr", "records", "numbers, such as '<f4'",
                                  "a list of fields");
      }
      header.descr = text();
      return header.descr ? Status() : broken("a type in quotes");
    }
    if (key == "fortran_order") {
      if (take_word("True")) {
        header.is_fortran = true;
      } else if (take_word("False")) {
        header.is_fortran = false;
      } else {
        return broken("True or False");
      }
      return {};
    }
    if (key == "shape") return read_shape(header);
    return malformed_volume(name_, "header", "unknown key", "descr, fortran_order or shape",
                            shown_text(key));
  }

  Status read_shape(NpyHeader& header) {
    if (!take('(')) return broken("'('");
    std::vector<uint64_t>& shape = header.shape.emplace();
    while (!take(')')) {
      skip_blanks();
      const size_t end = std::min(text_.find_first_not_of("0123456789", at_), text_.size());
      const auto side = parse_digits<uint64_t>(text_.substr(at_, end - at_));
      if (!side || shape.size() == kNpyAxesMax) return broken("the side of an axis or ')'");
      shape.push_back(*side);
      at_ = end;
      take('L');  // Python 2 wrote it
      if (take(',')) continue;
      if (!take(')')) return broken("',' or ')'");
      break;
    }
    return {};
  }

  Error broken(std::string_view expected) {
    skip_blanks();
    const std::string_view rest = text_.substr(at_);
    return malformed_volume(name_, "header", "character " + std::to_string(at_),
                            std::string(expected),
                            rest.empty() ? "the end of the header" : shown_text(rest.substr(0, 8)));
  }
  void skip_blanks() { at_ = std::min(text_.find_first_not_of(" \t\r\n", at_), text_.size()); }
  bool take(char c) {
    skip_blanks();
    if (!text_.substr(at_).starts_with(c)) return false;
    ++at_;
    return true;
  }
  bool take_word(std::string_view word) {
    skip_blanks();
    if (!text_.substr(at_).starts_with(word)) return false;
    at_ += word.size();
    return true;
  }
  // A text in quotes, without escapes.
  std::optional<std::string_view> text() {
    skip_blanks();
    if (at_ == text_.size() || (text_[at_] != '\'' && text_[at_] != '"')) return std::nullopt;
    const size_t end = text_.find(text_[at_], at_ + 1);
    if (end == std::string_view::npos) return std::nullopt;
    const std::string_view inside = text_.substr(at_ + 1, end - at_ - 1);
    at_ = end + 1;
    return inside;
  }

  std::string_view name_, text_;
  size_t at_ = 0;
};

// The dictionary's text, and the samples after it.
Result<std::pair<std::string_view, std::span<const uint8_t>>> npy_parts(
    std::string_view name, std::span<const uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (bytes.size() < kNpyPreambleBytes || !text.starts_with("\x93NUMPY")) {
    return malformed_volume(name, "byte 0", "not an array", "the magic \\x93NUMPY and a version",
                            "other bytes");
  }
  const int major = bytes[6], minor = bytes[7];
  if (major < 1 || major > 3 || minor != 0) {
    return malformed_volume(name, "byte 6", "version", "1.0, 2.0 or 3.0",
                            std::to_string(major) + "." + std::to_string(minor));
  }
  const size_t length_bytes = major == 1 ? 2 : 4;
  size_t begin = kNpyPreambleBytes + length_bytes;
  if (bytes.size() < begin) {
    return malformed_volume(name, "byte 8", "the file ends", "the length of the header");
  }
  size_t length = 0;
  for (size_t i = 0; i < length_bytes; ++i) length |= size_t{bytes[kNpyPreambleBytes + i]} << 8 * i;
  if (bytes.size() - begin < length) {
    return malformed_volume(name, "byte 8", "the header is longer than the file",
                            "at most " + std::to_string(bytes.size() - begin) + " bytes",
                            std::to_string(length));
  }
  return std::pair(text.substr(begin, length), bytes.subspan(begin + length));
}

// Sets the type of the samples.
Status read_npy_type(std::string_view name, std::string_view descr, SampleArray& array) {
  constexpr std::pair<std::string_view, SampleType> kTypes[] = {
      {"b1", SampleType::kBool},    {"i1", SampleType::kInt8},    {"u1", SampleType::kUint8},
      {"i2", SampleType::kInt16},   {"u2", SampleType::kUint16},  {"i4", SampleType::kInt32},
      {"u4", SampleType::kUint32},  {"i8", SampleType::kInt64},   {"u8", SampleType::kUint64},
      {"f2", SampleType::kFloat16}, {"f4", SampleType::kFloat32}, {"f8", SampleType::kFloat64}};
  for (const auto& [word, type] : kTypes) {
    if (descr.empty() || descr.substr(1) != word) continue;
    const bool is_byte = sample_bytes(type) == 1;
    if (std::string_view(is_byte ? "|<>=" : "<>=").find(descr[0]) == std::string_view::npos) break;
    array.type = type;
    array.is_big_endian = descr[0] == '>';
    return {};
  }
  return unsupported_volume(name, "descr", "the type of samples",
                            "|b1, |u1, |i1, or <u2, <i2, <f2, ... <u8, <i8, <f8, or > for <",
                            shown_text(descr));
}

std::string npy_shape_text(const std::vector<uint64_t>& shape) {
  std::string text = "(";
  for (const uint64_t side : shape) text += (text.size() > 1 ? ", " : "") + std::to_string(side);
  return text + ")";
}

// Sets sides, order and components.
Status read_npy_shape(std::string_view name, const NpyHeader& header, SampleArray& array) {
  const std::vector<uint64_t>& shape = *header.shape;
  const bool has_color = shape.size() == 4 && (shape[3] == 3 || shape[3] == 4);
  if (shape.size() != 3 && !has_color) {
    return unsupported_volume(name, "shape", "the axes of the array",
                              "(z, y, x), or (z, y, x, 3 or 4) for colours", npy_shape_text(shape));
  }
  std::array<int64_t, 3> sides{};
  for (size_t i = 0; i < 3; ++i) {
    if (shape[i] == 0) {
      return malformed_volume(name, "shape", "an array without samples", "sides from 1 on",
                              npy_shape_text(shape));
    }
    sides[i] = static_cast<int64_t>(std::min<uint64_t>(shape[i], INT64_MAX));
  }
  VOXELD_TRY(check_volume_dims(name, {sides[2], sides[1], sides[0]}));
  if (has_color && array.type != SampleType::kUint8 && array.type != SampleType::kFloat32) {
    return unsupported_volume(name, "descr", "the type of colours", "|u1, <f4 or >f4",
                              shown_text(*header.descr));
  }
  const auto z = static_cast<uint32_t>(sides[0]), y = static_cast<uint32_t>(sides[1]),
             x = static_cast<uint32_t>(sides[2]);
  const CellOrder c_order{{x, y, z}, {0, 1, 2}}, fortran_order{{z, y, x}, {2, 1, 0}};
  array.order = *header.is_fortran ? fortran_order : c_order;
  array.components = has_color ? shape[3] : 1;
  array.is_planar = has_color && *header.is_fortran;
  return {};
}

}  // namespace

Result<Volume> read_npy(std::string_view name, std::span<const uint8_t> bytes, double threshold) {
  VOXELD_ASSIGN(const auto parts, npy_parts(name, bytes));
  const auto& [text, samples] = parts;
  VOXELD_ASSIGN(const NpyHeader header, NpyDictionary(name, text).read());
  SampleArray array;
  array.threshold = threshold;
  VOXELD_TRY(read_npy_type(name, *header.descr, array));
  VOXELD_TRY(read_npy_shape(name, header, array));
  if (samples.size() != array.bytes()) {
    return malformed_volume(name, "data", "the samples are not those of the shape",
                            std::to_string(array.bytes()) + " bytes",
                            std::to_string(samples.size()));
  }
  Volume volume;
  const auto side = [&](size_t axis) { return static_cast<int>((*header.shape)[2 - axis]); };
  volume.grid.spec.dims = {side(0), side(1), side(2)};
  volume.grid.channels.color = array.has_color();
  VOXELD_ASSIGN(volume.grid.tiles, tiles_of_samples(array, name, samples));
  return volume;
}

}  // namespace voxeld::volumes
