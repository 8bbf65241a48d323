// NBT, the named binary tags of Minecraft. Numbers are big-endian.
//
//   tag        id u8, name (bytes u16, modified UTF-8), payload
//   compound   tags, and a tag of id 0 without a name
//   list       id u8 of its items, count i32, their payloads without id and name
//   array      count i32, numbers
//   text       bytes u16, modified UTF-8
//
// A file is one compound. Only ASCII is written, which modified UTF-8 does not modify.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace voxeld::minecraft {

enum class NbtTag : uint8_t {
  kEnd = 0,
  kShort = 2,
  kInt = 3,
  kLong = 4,
  kDouble = 6,
  kByteArray = 7,
  kString = 8,
  kList = 9,
  kCompound = 10,
  kIntArray = 11,
  kLongArray = 12
};

// Appends tags to bytes in memory.
class NbtWriter {
 public:
  // The compound that is open until end(). Items of lists of compounds end with end() alone.
  void begin(std::string_view name) { tag(NbtTag::kCompound, name); }
  void end() { number(uint8_t{0}); }

  void add_short(std::string_view name, uint16_t value);  // which readers may take for signed
  void add_int(std::string_view name, int32_t value);
  void add_long(std::string_view name, int64_t value);
  void add_text(std::string_view name, std::string_view value);           // at most 65535 bytes
  void add_ints(std::string_view name, std::span<const int32_t> values);  // an array
  void add_int_list(std::string_view name, std::span<const int32_t> values);
  void add_double_list(std::string_view name, std::span<const double> values);

  // Begins a list or an array; `count` payloads follow.
  void begin_list(std::string_view name, NbtTag items, int32_t count);
  void begin_array(NbtTag array, std::string_view name, int32_t count);
  void add_empty_list(std::string_view name) { begin_list(name, NbtTag::kEnd, 0); }

  const std::vector<uint8_t>& bytes() const { return bytes_; }
  void clear() { bytes_.clear(); }

 private:
  template <typename Unsigned>
  void number(Unsigned value) {
    for (size_t i = sizeof value; i-- > 0;) {
      bytes_.push_back(static_cast<uint8_t>(value >> (8 * i)));
    }
  }
  void text(std::string_view value);
  void tag(NbtTag id, std::string_view name);

  std::vector<uint8_t> bytes_;
};

}  // namespace voxeld::minecraft
