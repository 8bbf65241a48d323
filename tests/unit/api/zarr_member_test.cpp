#include "server/api/resources/zarr_member.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace voxeld::api {
namespace {

using Bytes = std::vector<uint8_t>;

void put(Bytes& out, uint64_t value, size_t bytes) {
  for (size_t i = 0; i < bytes; ++i) out.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

// One member "a/b" with the bytes 1 2 3, as ZipWriter::store() writes it; its directory begins at
// byte 56.
Bytes archive() {
  Bytes zip(30 + 3 + 20);
  zip.insert(zip.end(), {1, 2, 3});
  const size_t directory = zip.size();
  put(zip, 0x02014b50, 4);
  zip.resize(directory + 28);
  put(zip, 3, 2);
  put(zip, 28, 2);
  zip.resize(directory + 46);
  zip.insert(zip.end(), {'a', '/', 'b'});
  put(zip, 1, 2);
  put(zip, 24, 2);
  for (const uint64_t number : {3, 3, 0}) put(zip, number, 8);
  const size_t end = zip.size();
  put(zip, 0x06064b50, 4);
  zip.resize(end + 40);
  put(zip, end - directory, 8);
  put(zip, directory, 8);
  zip.resize(end + 98);
  return zip;
}

ErrorCode code_of(const Bytes& zip, std::string_view name = "a/b") {
  const auto found = find_zip_member(zip, name);
  EXPECT_FALSE(found);
  return found ? ErrorCode::kCancelled : found.error().code;
}

TEST(ZarrMember, bytes_of_a_member_are_found) {
  const auto member = find_zip_member(archive(), "a/b");
  ASSERT_TRUE(member) << member.error().message();
  EXPECT_EQ(member->offset, 53U);
  EXPECT_EQ(member->bytes, 3U);
}

TEST(ZarrMember, other_names_are_not_found) {
  for (const char* name : {"", "a", "a/", "a/b/", "A/b", "../a/b"}) {
    EXPECT_EQ(code_of(archive(), name), ErrorCode::kNotFound) << name;
  }
}

TEST(ZarrMember, broken_archives_are_refused) {
  const Bytes whole = archive();
  for (size_t bytes = 0; bytes < whole.size(); ++bytes) {
    EXPECT_EQ(code_of(Bytes(whole.begin(), whole.begin() + static_cast<ptrdiff_t>(bytes))),
              ErrorCode::kInternal)
        << bytes;
  }
  constexpr size_t kDirectory = 56, kExtra = kDirectory + 46 + 3;
  for (const size_t at : {kDirectory, kDirectory + 10, kDirectory + 28, kDirectory + 30,
                          kExtra + 12, kExtra + 19, kExtra + 20, kExtra + 27}) {
    Bytes broken = whole;
    broken[at] ^= 0xff;
    EXPECT_EQ(code_of(broken), ErrorCode::kInternal) << at;
  }
}

}  // namespace
}  // namespace voxeld::api
