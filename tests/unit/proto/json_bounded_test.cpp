#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "proto/limits.h"
#include "proto/messages/job.h"
#include "proto/messages/json_bounds.h"

namespace voxeld {
namespace {

std::string nested(int depth, char open, char close) {
  return std::string(static_cast<size_t>(depth), open) +
         std::string(static_cast<size_t>(depth), close);
}

Error error_of(std::string_view text) {
  const auto json = parse_json_bounded(text);
  EXPECT_FALSE(json) << text.substr(0, 80);
  return json ? Error{} : json.error();
}

TEST(JsonBounded, reads_written_values) {
  const auto json = parse_json_bounded(R"({"a": [1, -2, 2.5, "x", null, true], "b": {"a": {}}})");
  ASSERT_TRUE(json) << json.error().message();
  EXPECT_EQ((*json)["a"].dump(), R"([1,-2,2.5,"x",null,true])");
  EXPECT_EQ((*json)["b"].dump(), R"({"a":{}})");
}

TEST(JsonBounded, the_deepest_allowed_nesting_is_read_and_one_more_is_refused) {
  EXPECT_TRUE(parse_json_bounded(nested(limits::kJsonDepthMax, '[', ']')));
  const Error error = error_of(nested(limits::kJsonDepthMax + 1, '[', ']'));
  EXPECT_EQ(error.code, ErrorCode::kBadRequest);
  EXPECT_EQ(error.message(),
            "JSON: depth of nesting is over the limit: expected at most 64, got more");
}

TEST(JsonBounded, depth_counts_objects_and_arrays_together) {
  std::string text;
  for (int i = 0; i < limits::kJsonDepthMax / 2; ++i) text += "[{\"a\":";
  std::string ends;
  for (int i = 0; i < limits::kJsonDepthMax / 2; ++i) ends += "}]";
  EXPECT_TRUE(parse_json_bounded(text + "1" + ends));
  EXPECT_FALSE(parse_json_bounded(text + "[]" + ends));
}

TEST(JsonBounded, siblings_do_not_add_to_the_depth) {
  std::string text = "[";
  for (int i = 0; i < 1000; ++i) text += "[],{},";
  EXPECT_TRUE(parse_json_bounded(text + "0]"));
}

TEST(JsonBounded, deep_nesting_without_an_end_is_refused_before_it_can_overflow_a_stack) {
  const Error error = error_of(std::string(1'000'000, '['));
  EXPECT_EQ(error.message(),
            "JSON: depth of nesting is over the limit: expected at most 64, got more");
}

TEST(JsonBounded, the_largest_allowed_text_is_read_and_one_byte_more_is_refused) {
  const auto limit = static_cast<size_t>(limits::kJsonBodyBytesMax);
  const std::string text = "\"" + std::string(limit - 2, 'a') + "\"";
  EXPECT_TRUE(parse_json_bounded(text));
  const Error error = error_of(text + " ");
  EXPECT_EQ(error.code, ErrorCode::kPayloadTooLarge);
  EXPECT_EQ(error.message(), "JSON body is too large: expected at most 1048576 bytes, got 1048577");
}

TEST(JsonBounded, values_and_members_are_counted_where_they_are_bounded) {
  const JsonBounds three{.values_max = 3, .members_max = 2};
  EXPECT_TRUE(parse_json_bounded("[1, 2]", three));
  EXPECT_EQ(parse_json_bounded("[1, [2]]", three).error().message(),
            "JSON: too many values: expected at most 3, got more");
  EXPECT_TRUE(parse_json_bounded(R"({"a": 1, "b": 2})", three));
  EXPECT_EQ(parse_json_bounded(R"({"a": 1, "b": 2, "c": 3})", three).error().message(),
            "JSON: too many members in one object: expected at most 2, got more");
  EXPECT_EQ(parse_json_bounded("[[]]", JsonBounds{.depth_max = 1}).error().message(),
            "JSON: depth of nesting is over the limit: expected at most 1, got more");
}

TEST(JsonBounded, a_key_that_stands_twice_is_refused_also_where_it_is_spelled_otherwise) {
  EXPECT_EQ(error_of(R"({"a": 1, "b": 2, "a": 3})").message(),
            "JSON: key \"a\" stands twice in an object: expected distinct keys, got a duplicate");
  EXPECT_EQ(error_of(R"({"a": 1, "\u0061": 3})").message(),
            "JSON: key \"a\" stands twice in an object: expected distinct keys, got a duplicate");
  EXPECT_TRUE(parse_json_bounded(R"([{"a": 1}, {"a": 2, "b": {"a": 3}}])"));
}

TEST(JsonBounded, syntax_errors_name_the_byte) {
  struct Case {
    std::string_view text;
    int byte;
  };
  for (const auto& [text, byte] :
       {Case{"", 1}, Case{"   ", 4}, Case{"{\"a\": }", 7}, Case{"[1,]", 4}, Case{"[1] [2]", 5},
        Case{"nul", 4}, Case{"{'a': 1}", 2}, Case{"[01]", 3}, Case{"[NaN]", 2}}) {
    const Error error = error_of(text);
    EXPECT_EQ(error.code, ErrorCode::kBadRequest);
    EXPECT_EQ(error.message(),
              "JSON: syntax error at byte " + std::to_string(byte) + ": expected a JSON value")
        << text;
  }
}

TEST(JsonBounded, numbers_beyond_double_and_texts_that_are_not_utf8_are_refused) {
  EXPECT_EQ(error_of("[1e999]").code, ErrorCode::kBadRequest);
  EXPECT_EQ(error_of("[\"\xff\"]").code, ErrorCode::kBadRequest);
  EXPECT_EQ(error_of("[\"\xed\xa0\x80\"]").code, ErrorCode::kBadRequest);
  EXPECT_EQ(error_of(R"(["\ud800"])").code, ErrorCode::kBadRequest);
}

}  // namespace
}  // namespace voxeld
