// Writes zips byte by byte, true ones and lying ones.
#pragma once

#include <zlib.h>

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace voxeld::test {

struct ZipEntry {
  std::string name;
  std::string data;
  bool deflated = false;         // as stored blocks of a deflate stream
  uint16_t flags = 0;            // bit 0: encrypted
  uint32_t unix_mode = 0100644;  // 0120777 is a link
  int64_t declared_bytes = -1;   // inflated size in the headers; -1: the truth
  int64_t declared_stored = -1;  // stored size in the headers
  bool wrong_checksum = false;
};

class ZipMaker {
 public:
  ZipMaker& add(ZipEntry entry) {
    entries_.push_back(std::move(entry));
    return *this;
  }
  ZipMaker& add(std::string name, std::string data) {
    return add(ZipEntry{.name = std::move(name), .data = std::move(data)});
  }

  std::string bytes() const {
    std::string out, directory;
    for (const ZipEntry& entry : entries_) {
      const std::string stored = entry.deflated ? deflate_stored(entry.data) : entry.data;
      const std::string common = common_header(entry, stored.size());
      directory += "PK\1\2" + u16(3 << 8 | 20) + common + u16(entry.name.size()) + u16(0) + u16(0) +
                   u16(0) + u16(0) + u32(uint64_t{entry.unix_mode} << 16) + u32(out.size()) +
                   entry.name;
      out += "PK\3\4" + common + u16(entry.name.size()) + u16(0) + entry.name + stored;
    }
    const size_t start = out.size();
    out += directory + "PK\5\6" + u16(0) + u16(0) + u16(entries_.size()) + u16(entries_.size()) +
           u32(directory.size()) + u32(start) + u16(0);
    return out;
  }

  static std::string u16(uint64_t value) { return number(value, 2); }
  static std::string u32(uint64_t value) { return number(value, 4); }

 private:
  static std::string number(uint64_t value, int byte_count) {
    std::string out;
    for (int i = 0; i < byte_count; ++i) out += static_cast<char>(value >> (8 * i) & 0xff);
    return out;
  }

  static std::string common_header(const ZipEntry& entry, size_t stored_bytes) {
    const auto size = [](int64_t declared, size_t truth) {
      return u32(declared < 0 ? truth : static_cast<uint64_t>(declared));
    };
    const uint32_t checksum = crc_of(entry.data) ^ (entry.wrong_checksum ? 1u : 0u);
    return u16(20) + u16(entry.flags) + u16(entry.deflated ? 8 : 0) + u16(0) + u16(0x5821) +
           u32(checksum) + size(entry.declared_stored, stored_bytes) +
           size(entry.declared_bytes, entry.data.size());
  }

  static std::string deflate_stored(std::string_view data) {
    std::string out;
    do {
      const std::string_view block = data.substr(0, 65535);
      data.remove_prefix(block.size());
      out += data.empty() ? '\1' : '\0';
      out += u16(block.size()) + u16(~block.size()) + std::string(block);
    } while (!data.empty());
    return out;
  }

  static uint32_t crc_of(std::string_view data) {
    return static_cast<uint32_t>(
        crc32(0, reinterpret_cast<const Bytef*>(data.data()), static_cast<uInt>(data.size())));
  }

  std::vector<ZipEntry> entries_;
};

}  // namespace voxeld::test
