// Suggestions for misspelt names.
#include "proto/text/near_miss.h"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <tuple>

namespace voxeld {
namespace {

constexpr std::array<std::string_view, 3> kPage = {"limit", "after", "state"};
constexpr std::array<std::string_view, 7> kMany = {"size", "dims",  "sign", "padding",
                                                   "up",   "units", "rule"};

TEST(NearMiss, edits_are_counted_once_each) {
  for (const auto& [a, b, edits] : {std::tuple{"", "", 0},
                                    {"", "abc", 3},
                                    {"size", "size", 0},
                                    {"size", "sie", 1},
                                    {"size", "sizes", 1},
                                    {"size", "sise", 1},
                                    {"limti", "limit", 1},
                                    {"abcdef", "badcfe", 3},
                                    {"kitten", "sitting", 3}}) {
    EXPECT_EQ(edit_distance(a, b), static_cast<size_t>(edits)) << a << " " << b;
    EXPECT_EQ(edit_distance(b, a), static_cast<size_t>(edits)) << b << " " << a;
  }
}

TEST(NearMiss, is_the_nearest_name_within_an_edit_for_three_letters) {
  EXPECT_EQ(near_miss("limti", kPage), "limit");
  EXPECT_EQ(near_miss("limits", kPage), "limit");
  EXPECT_EQ(near_miss("afetr", kPage), "after");
  EXPECT_EQ(near_miss("page", kPage), "");
  EXPECT_EQ(near_miss("u", kMany), "");
  EXPECT_EQ(near_miss("pu", kMany), "up");
  EXPECT_EQ(near_miss("", kPage), "");
  EXPECT_EQ(near_miss("limit", {}), "");
}

TEST(NearMiss, unknown_names_get_the_near_miss_or_the_known_names) {
  const Error near = unknown_name("parameter", "limti", kPage);
  EXPECT_EQ(near.code, ErrorCode::kUnknownOption);
  EXPECT_EQ(near.message(), "unknown parameter 'limti'; did you mean 'limit'?");
  EXPECT_EQ(unknown_name("parameter", "page", kPage).message(),
            "unknown parameter 'page': expected limit, after, state");
  EXPECT_EQ(unknown_name("parameter", "page", {}).message(),
            "unknown parameter 'page': expected none");
  EXPECT_EQ(unknown_name("option", "pardon", kMany).message(),
            "unknown option 'pardon': expected one of padding, sign, rule, …");
}

TEST(NearMiss, a_long_name_is_repeated_in_part) {
  EXPECT_EQ(unknown_name("parameter", std::string(5000, 'x'), {}).detail,
            "unknown parameter '" + std::string(40, 'x') + "'");
}

}  // namespace
}  // namespace voxeld
