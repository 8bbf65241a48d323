// Reads gzipped NBT by its specification, for tests alone: naive, and strict about the end.
#pragma once

#include <gtest/gtest.h>
#include <zlib.h>

#include <bit>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace voxeld::test {

inline std::vector<uint8_t> gunzipped(std::span<const uint8_t> bytes) {
  z_stream stream{};
  EXPECT_EQ(inflateInit2(&stream, 16 + MAX_WBITS), Z_OK);  // gzip alone
  stream.next_in = const_cast<uint8_t*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  std::vector<uint8_t> out, part(1 << 16);
  int status = Z_OK;
  while (status == Z_OK) {
    stream.next_out = part.data();
    stream.avail_out = static_cast<uInt>(part.size());
    status = inflate(&stream, Z_NO_FLUSH);
    out.insert(out.end(), part.begin(), part.end() - stream.avail_out);
  }
  EXPECT_EQ(status, Z_STREAM_END);  // zlib has compared length and CRC
  EXPECT_EQ(stream.avail_in, 0u);
  inflateEnd(&stream);
  return out;
}

struct Nbt {
  int tag = 0;
  std::string text;
  double real = 0;
  std::vector<int64_t> numbers;  // of a number or an array
  std::vector<Nbt> items;
  std::map<std::string, Nbt> members;

  const Nbt& operator[](const std::string& name) const {
    static const Nbt kNone;
    const auto found = members.find(name);
    EXPECT_NE(found, members.end()) << name;
    return found == members.end() ? kNone : found->second;
  }
  int64_t number() const {
    EXPECT_EQ(numbers.size(), 1u);
    return numbers.empty() ? 0 : numbers.front();
  }
};

class NbtReader {
 public:
  // The compound of a file. `name`: becomes its name.
  static Nbt read_gzip(std::span<const uint8_t> bytes, std::string& name) {
    const std::vector<uint8_t> raw = gunzipped(bytes);
    NbtReader reader(raw);
    EXPECT_EQ(reader.unsigned_of(1), 10u);
    name = reader.text();
    Nbt root = reader.payload(10);
    EXPECT_EQ(reader.at_, raw.size());
    return root;
  }

 private:
  explicit NbtReader(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  uint64_t unsigned_of(size_t count) {
    uint64_t value = 0;
    for (; count > 0; --count) {
      EXPECT_LT(at_, bytes_.size());
      value = value << 8 | (at_ < bytes_.size() ? bytes_[at_] : 0);
      ++at_;
    }
    return value;
  }
  int64_t signed_of(size_t count) {
    const unsigned unused = 64 - 8 * static_cast<unsigned>(count);
    return static_cast<int64_t>(unsigned_of(count) << unused) >> unused;
  }
  std::string text() {
    std::string value;
    for (auto left = unsigned_of(2); left > 0; --left) {
      value += static_cast<char>(unsigned_of(1));
    }
    return value;
  }

  Nbt payload(int tag) {
    Nbt nbt;
    nbt.tag = tag;
    const std::map<int, size_t> integers = {{1, 1}, {2, 2}, {3, 4}, {4, 8}};
    const std::map<int, size_t> arrays = {{7, 1}, {11, 4}, {12, 8}};
    if (const auto bytes = integers.find(tag); bytes != integers.end()) {
      nbt.numbers = {signed_of(bytes->second)};
    } else if (tag == 6) {
      nbt.real = std::bit_cast<double>(unsigned_of(8));
    } else if (tag == 8) {
      nbt.text = text();
    } else if (const auto array = arrays.find(tag); array != arrays.end()) {
      for (auto left = signed_of(4); left > 0; --left) {
        nbt.numbers.push_back(signed_of(array->second));
      }
    } else if (tag == 9) {
      const auto item = static_cast<int>(unsigned_of(1));
      for (auto left = signed_of(4); left > 0; --left) nbt.items.push_back(payload(item));
    } else if (tag == 10) {
      for (int member; (member = static_cast<int>(unsigned_of(1))) != 0;) {
        const std::string name = text();
        EXPECT_TRUE(nbt.members.emplace(name, payload(member)).second) << name;
      }
    } else {
      ADD_FAILURE() << "tag " << tag;
    }
    return nbt;
  }

  std::span<const uint8_t> bytes_;
  size_t at_ = 0;
};

}  // namespace voxeld::test
