#include "proto/text/percent_encoding.h"

#include <gtest/gtest.h>

#include <cctype>
#include <cstdio>
#include <string>

namespace voxeld {
namespace {

TEST(PercentEncoding, unreserved_characters_stay_and_all_other_bytes_are_two_digits) {
  for (int byte = 0; byte < 256; ++byte) {
    const std::string text(1, static_cast<char>(byte));
    const bool is_plain = (byte < 128 && std::isalnum(byte) != 0) || byte == '-' || byte == '.' ||
                          byte == '_' || byte == '~';
    char digits[4];
    std::snprintf(digits, sizeof digits, "%%%02X", static_cast<unsigned>(byte));
    EXPECT_EQ(percent_encode(text), is_plain ? text : digits) << byte;
  }
}

TEST(PercentEncoding, pinned_texts) {
  EXPECT_EQ(percent_encode(""), "");
  EXPECT_EQ(percent_encode("a b/c?d=e&f#g%h+i"), "a%20b%2Fc%3Fd%3De%26f%23g%25h%2Bi");
  EXPECT_EQ(percent_encode("gr\xc3\xbc\xc3\x9f"), "gr%C3%BC%C3%9F");
  EXPECT_EQ(percent_encode(std::string_view("a\0b", 3)), "a%00b");
}

TEST(PercentEncoding, named_characters_stay_unencoded) {
  EXPECT_EQ(percent_encode("1,2/3", ","), "1,2%2F3");
  EXPECT_EQ(percent_encode("1,2/3", ",/"), "1,2/3");
}

}  // namespace
}  // namespace voxeld
