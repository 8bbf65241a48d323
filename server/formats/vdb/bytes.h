// Little-endian numbers and texts of a VDB file, and its blocks of values.
#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

namespace voxeld::vdb {

using Bytes = std::vector<uint8_t>;

template <typename T>
std::span<const uint8_t> bytes_of(const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  return {reinterpret_cast<const uint8_t*>(&value), sizeof value};
}

template <typename T>
void put(Bytes& out, const T& value) {
  const auto bytes = bytes_of(value);
  out.insert(out.end(), bytes.begin(), bytes.end());
}
// u32 length, then the characters.
inline void put_text(Bytes& out, std::string_view text) {
  put(out, static_cast<uint32_t>(text.size()));
  out.insert(out.end(), text.begin(), text.end());
}

// Appends values as a block of compression "zip": i64 bytes of a zlib stream and the stream, or
// minus the number of raw bytes and these, where a stream is no smaller.
void put_block(Bytes& out, std::span<const uint8_t> raw, size_t value_bytes);

}  // namespace voxeld::vdb
