#include "client/cli/terminal/human.h"

#include <gtest/gtest.h>

namespace voxeld::cli {
namespace {

TEST(Human, counts_have_groups_of_three_digits) {
  EXPECT_EQ(count_text(0), "0");
  EXPECT_EQ(count_text(999), "999");
  EXPECT_EQ(count_text(1'000), "1,000");
  EXPECT_EQ(count_text(1'234'567), "1,234,567");
  EXPECT_EQ(count_text(-123), "-123");
  EXPECT_EQ(count_text(-123'456), "-123,456");
}

TEST(Human, bytes_have_two_digits_or_more_and_a_decimal_unit) {
  EXPECT_EQ(bytes_text(0), "0 B");
  EXPECT_EQ(bytes_text(999), "999 B");
  EXPECT_EQ(bytes_text(1'000), "1.0 kB");
  EXPECT_EQ(bytes_text(9'940), "9.9 kB");
  EXPECT_EQ(bytes_text(9'960), "10 kB");
  EXPECT_EQ(bytes_text(999'600), "1.0 MB");
  EXPECT_EQ(bytes_text(34'500'000), "34 MB");
  EXPECT_EQ(bytes_text(5'000'000'000'000), "5.0 TB");
}

TEST(Human, seconds_have_three_digits_or_two_units) {
  EXPECT_EQ(seconds_text(0.0421), "0.042 s");
  EXPECT_EQ(seconds_text(1.236), "1.24 s");
  EXPECT_EQ(seconds_text(12.34), "12.3 s");
  EXPECT_EQ(seconds_text(59.96), "1 min 0 s");
  EXPECT_EQ(seconds_text(192), "3 min 12 s");
  EXPECT_EQ(seconds_text(7'500), "2 h 5 min");
}

TEST(Human, an_age_has_one_unit) {
  EXPECT_EQ(age_text(1'000, 13'500), "12 s");
  EXPECT_EQ(age_text(0, 61'000), "1 min");
  EXPECT_EQ(age_text(0, 3 * 3'600'000), "3 h");
  EXPECT_EQ(age_text(0, 50LL * 3'600'000), "2 d");
  EXPECT_EQ(age_text(5'000, 1'000), "0 s");  // of a clock that is ahead
}

TEST(Human, a_table_aligns_its_columns) {
  Table table("lrl");
  table.add({"ID", "SIZE", "FILE"});
  table.add({"j-1", "12 kB", "Würfel.obj"});
  table.add({"j-22", "3 B"});
  EXPECT_EQ(table.text(),
            "ID     SIZE  FILE\n"
            "j-1   12 kB  Würfel.obj\n"
            "j-22    3 B\n");
}

TEST(Human, control_characters_do_not_reach_a_terminal) {
  EXPECT_EQ(printable("Würfel"), "Würfel");
  EXPECT_EQ(printable("a\x1b]0;b\a\n\x7f"), "a?]0;b???");
  EXPECT_EQ(printable("\xc2\x9b[J\xc2"), "?[J\xc2");  // CSI as one character; half of one
  Table table("l");
  table.add({"\x1b[2J"});
  EXPECT_EQ(table.text(), "?[2J\n");
}

}  // namespace
}  // namespace voxeld::cli
