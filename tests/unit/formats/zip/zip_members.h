// Reads zip archives by their directory (PKWARE's APPNOTE 6.3, zip64 fields included), for tests
// alone.
#pragma once

#include <gtest/gtest.h>
#include <zlib.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace voxeld::test {

struct ZipMember {
  std::string name;
  bool is_stored = false;
  std::vector<uint8_t> bytes;
};

// The members in the order of the directory; checksums and lengths are checked.
class ZipMembers {
 public:
  explicit ZipMembers(std::vector<uint8_t> zip) : zip_(std::move(zip)) { read(); }

  const std::vector<ZipMember>& all() const { return members_; }
  // Fails the test if there is no such member.
  std::vector<uint8_t> at(const std::string& name) const {
    for (const ZipMember& member : members_) {
      if (member.name == name) return member.bytes;
    }
    ADD_FAILURE() << "no member " << name;
    return {};
  }
  std::string text(const std::string& name) const {
    const std::vector<uint8_t> bytes = at(name);
    return {bytes.begin(), bytes.end()};
  }

 private:
  uint64_t number(uint64_t at, size_t count) const {
    uint64_t value = 0;
    for (size_t i = 0; i < count; ++i) value |= uint64_t{zip_.at(at + i)} << (8 * i);
    return value;
  }

  void read() {
    const uint64_t end = zip_.size() - 22;  // of the record without a comment
    ASSERT_EQ(number(end, 4), 0x06054b50U);
    ASSERT_EQ(number(end - 20, 4), 0x07064b50U);
    const uint64_t end64 = number(end - 12, 8);
    ASSERT_EQ(number(end64, 4), 0x06064b50U);
    const uint64_t count = number(end64 + 32, 8);
    uint64_t at = number(end64 + 48, 8);
    for (uint64_t i = 0; i < count; ++i) {
      ASSERT_EQ(number(at, 4), 0x02014b50U);
      const uint64_t name = number(at + 28, 2), extra = number(at + 30, 2);
      const uint64_t sizes = at + 46 + name + 4;  // the fields of zip64
      ZipMember& member = members_.emplace_back();
      for (uint64_t c = 0; c < name; ++c) member.name += static_cast<char>(zip_.at(at + 46 + c));
      member.is_stored = number(at + 10, 2) == 0;
      const uint64_t raw = number(sizes, 8), stored = number(sizes + 8, 8);
      const uint64_t local = number(sizes + 16, 8);
      const uint64_t data = local + 30 + number(local + 26, 2) + number(local + 28, 2);
      member.bytes = member_bytes(member.is_stored, data, stored, raw);
      EXPECT_EQ(crc32(0, member.bytes.data(), static_cast<uInt>(member.bytes.size())),
                number(at + 16, 4))
          << member.name;
      at += 46 + name + extra;
    }
  }

  std::vector<uint8_t> member_bytes(bool is_stored, uint64_t at, uint64_t stored, uint64_t raw) {
    std::vector<uint8_t> out(raw);
    if (is_stored) {
      EXPECT_EQ(stored, raw);
      for (uint64_t i = 0; i < raw; ++i) out[i] = zip_.at(at + i);
      return out;
    }
    z_stream z{};
    EXPECT_EQ(inflateInit2(&z, -15), Z_OK);
    z.next_in = zip_.data() + at;
    z.avail_in = static_cast<uInt>(stored);
    z.next_out = out.data();
    z.avail_out = static_cast<uInt>(raw);
    EXPECT_EQ(inflate(&z, Z_FINISH), Z_STREAM_END);
    EXPECT_EQ(z.total_out, raw);
    EXPECT_EQ(z.avail_in, 0U);
    inflateEnd(&z);
    return out;
  }

  std::vector<uint8_t> zip_;
  std::vector<ZipMember> members_;
};

}  // namespace voxeld::test
