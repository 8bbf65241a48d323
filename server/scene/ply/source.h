// Sources of the numbers of a PLY body: text, or bytes of either order. Both have the same
// functions, so the reader is written only once.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/ply/header.h"

namespace voxeld {

class PlyTextSource {
 public:
  PlyTextSource(std::span<const uint8_t> bytes, int64_t first_line)
      : cursor_(as_text(bytes), '\0', first_line) {}

  // The next number; NaN for "nan" and numbers that are too large. nullopt for other words and at
  // the end.
  std::optional<double> number(PlyType) {
    word_ = cursor_.token();
    if (const auto value = parse_number(word_)) return value;
    return is_not_finite(word_) ? std::optional(std::numeric_limits<double>::quiet_NaN())
                                : std::nullopt;
  }
  bool skip(PlyType, uint64_t count) {
    for (; count > 0; --count) {
      word_ = cursor_.token();
      if (word_.empty()) return false;
    }
    return true;
  }
  uint64_t bytes_left() const { return cursor_.bytes_left(); }
  std::string where() const { return "line " + std::to_string(cursor_.line()); }
  // The last word, for errors.
  std::string got() const { return shown(word_); }

 private:
  // Accepts "nan", "-nan(ind)", "inf", "1e999", "1.#QNAN", as C libraries print them.
  static bool is_not_finite(std::string_view word) {
    if (word.find_first_not_of("0123456789+-.eE#nNaAiIfFdDqQtTyYsS()") != word.npos) return false;
    for (const std::string_view mark : {"nan", "NaN", "NAN", "inf", "Inf", "INF", "#", "e", "E"}) {
      if (word.find(mark) != word.npos) return true;
    }
    return false;
  }

  TextCursor cursor_;
  std::string_view word_;
};

class PlyBinarySource {
 public:
  PlyBinarySource(std::span<const uint8_t> bytes, size_t offset, bool swapped)
      : bytes_(bytes), offset_(offset), swapped_(swapped) {}

  std::optional<double> number(PlyType type) {
    switch (type) {
      case PlyType::kInt8:
        return read<int8_t, uint8_t>();
      case PlyType::kUint8:
        return read<uint8_t, uint8_t>();
      case PlyType::kInt16:
        return read<int16_t, uint16_t>();
      case PlyType::kUint16:
        return read<uint16_t, uint16_t>();
      case PlyType::kInt32:
        return read<int32_t, uint32_t>();
      case PlyType::kUint32:
        return read<uint32_t, uint32_t>();
      case PlyType::kFloat32:
        return read<float, uint32_t>();
      case PlyType::kFloat64:
        return read<double, uint64_t>();
    }
    return std::nullopt;
  }
  bool skip(PlyType type, uint64_t count) {
    const uint64_t size = ply_type_bytes(type);
    if (count > bytes_left() / size) return false;
    offset_ += count * size;
    return true;
  }
  uint64_t bytes_left() const { return bytes_.size() - offset_; }
  std::string where() const { return "byte " + std::to_string(offset_); }
  std::string got() const { return "the end of the file"; }

 private:
  template <typename Value, typename Bits>
  std::optional<double> read() {
    if (bytes_left() < sizeof(Bits)) return std::nullopt;
    Bits bits;
    std::memcpy(&bits, bytes_.data() + offset_, sizeof(Bits));
    offset_ += sizeof(Bits);
    if (swapped_) bits = byte_swapped(bits);
    return static_cast<double>(std::bit_cast<Value>(bits));
  }
  template <typename Bits>
  static Bits byte_swapped(Bits bits) {
    if constexpr (sizeof(Bits) == 2) return __builtin_bswap16(bits);
    if constexpr (sizeof(Bits) == 4) return __builtin_bswap32(bits);
    if constexpr (sizeof(Bits) == 8) return __builtin_bswap64(bits);
    return bits;
  }

  std::span<const uint8_t> bytes_;
  size_t offset_;
  bool swapped_;  // the file's byte order is not this machine's
};

}  // namespace voxeld
