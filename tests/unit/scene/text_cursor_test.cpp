#include "server/scene/core/text_cursor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/unit/base/points_passed.h"

namespace voxeld {
namespace {

TEST(ParseNumber, reads_the_forms_that_exporters_write) {
  EXPECT_EQ(parse_number("1"), 1.0);
  EXPECT_EQ(parse_number("-0.5"), -0.5);
  EXPECT_EQ(parse_number("+.5"), 0.5);
  EXPECT_EQ(parse_number("5."), 5.0);
  EXPECT_EQ(parse_number("1e-3"), 0.001);
  EXPECT_EQ(parse_number("1E+03"), 1000.0);
  EXPECT_EQ(parse_number("1e-999"), 0.0);
}

TEST(ParseNumber, refuses_everything_else) {
  for (const char* word : {"", "+", "-", ".", "+-1", "1,5", "0x10", "1 ", "1e", "nan", "-inf",
                           "inf", "1e999", "1.#QNAN", "abc", "1/2"}) {
    EXPECT_EQ(parse_number(word), std::nullopt) << word;
  }
}

TEST(ParseNumber, words_for_non_finite_numbers_differ_from_words_that_are_none) {
  for (const char* word : {"nan", "NaN", "-nan", "nan(ind)", "-nan(ind)", "inf", "-Infinity",
                           "1.#QNAN", "-1.#IND000", "1.#INF", "1e999", "-1e999"}) {
    const auto number = parse_number_or_nan(word);
    ASSERT_TRUE(number) << word;
    EXPECT_TRUE(std::isnan(*number)) << word;
  }
  for (const char* word : {"", "-", "red", "nancy", "info", "1e", "--nan", "0x10"}) {
    EXPECT_EQ(parse_number_or_nan(word), std::nullopt) << word;
  }
  EXPECT_EQ(parse_number_or_nan("-0.5"), -0.5);
  EXPECT_EQ(parse_number_or_nan("1e-999"), 0.0);
}

TEST(ParseNumber, a_number_has_at_most_4096_bytes) {
  const std::string longest = "1" + std::string(4095, '0'), zeros(4096, '0');
  EXPECT_EQ(parse_number(zeros), 0.0);
  EXPECT_EQ(parse_number("0" + zeros), std::nullopt);
  EXPECT_TRUE(parse_number_or_nan(longest));
  EXPECT_EQ(parse_number_or_nan("0" + longest), std::nullopt);
  EXPECT_EQ(parse_integer(zeros), 0);
  EXPECT_EQ(parse_integer("0" + zeros), std::nullopt);
}

TEST(ParseInteger, takes_whole_numbers_in_any_notation) {
  EXPECT_EQ(parse_integer("42"), 42);
  EXPECT_EQ(parse_integer("-1"), -1);
  EXPECT_EQ(parse_integer("+7"), 7);
  EXPECT_EQ(parse_integer("3.0"), 3);
  for (const char* word : {"", "3.5", "x", "1e300", "99999999999999999999"}) {
    EXPECT_EQ(parse_integer(word), std::nullopt) << word;
  }
}

TEST(TextCursor, counts_lines_and_skips_comments) {
  TextCursor cursor("a b # not this\n\n  c\r\nd", '#');
  EXPECT_EQ(cursor.token(), "a");
  EXPECT_EQ(cursor.token_on_line(), "b");
  EXPECT_EQ(cursor.token_on_line(), "");
  EXPECT_EQ(cursor.token(), "c");
  EXPECT_EQ(cursor.line(), 3);
  EXPECT_EQ(cursor.rest_of_line(), "");
  EXPECT_EQ(cursor.token(), "d");
  EXPECT_EQ(cursor.line(), 4);
  EXPECT_EQ(cursor.token(), "");
  EXPECT_EQ(cursor.rest_of_line(), "");
}

TEST(TextCursor, an_empty_text_has_no_words) {
  TextCursor cursor({});
  EXPECT_EQ(cursor.token(), "");
  EXPECT_EQ(cursor.token_on_line(), "");
  EXPECT_EQ(cursor.rest_of_line(), "");
}

TEST(TextCursor, blanks_lines_and_words_of_a_mebibyte_can_be_cancelled) {
  for (const char c : {' ', '\n', 'x'}) {
    const std::string text(size_t{1} << 20, c);
    EXPECT_GE(test::points_passed([&] { (void)TextCursor(text).token(); }), 15) << c;
    if (c == '\n') continue;
    EXPECT_GE(test::points_passed([&] { (void)TextCursor(text).token_on_line(); }), 15) << c;
  }
  const std::string line(size_t{16} << 20, 'x');
  EXPECT_GE(test::points_passed([&] { (void)TextCursor(line).rest_of_line(); }), 15);
}

TEST(LineCursor, blanks_and_words_of_a_mebibyte_can_be_cancelled) {
  const std::string blanks(size_t{1} << 20, ' '), word(size_t{1} << 20, 'x');
  EXPECT_GE(test::points_passed([&] { (void)LineCursor(blanks).token(); }), 15);
  EXPECT_GE(test::points_passed([&] { (void)LineCursor(blanks).rest(); }), 15);
  EXPECT_GE(test::points_passed([&] { (void)LineCursor(word).token(); }), 15);
}

}  // namespace
}  // namespace voxeld
