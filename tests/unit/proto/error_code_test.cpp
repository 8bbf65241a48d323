#include "proto/error_code.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <set>
#include <string>

#include "proto/result.h"

namespace voxeld {
namespace {

bool is_kebab_case(std::string_view name) {
  const bool letters = std::ranges::all_of(
      name, [](char c) { return std::islower(static_cast<unsigned char>(c)) != 0 || c == '-'; });
  return letters && !name.empty() && !name.starts_with('-') && !name.ends_with('-') &&
         name.find("--") == std::string_view::npos;
}

TEST(ErrorCode, every_code_has_a_unique_name_in_kebab_case_that_leads_back_to_it) {
  std::set<std::string_view> names;
  for (const ErrorCodeInfo& info : all_error_codes()) {
    EXPECT_TRUE(is_kebab_case(info.name)) << info.name;
    EXPECT_TRUE(names.insert(info.name).second) << info.name;
    EXPECT_EQ(error_code_from_name(info.name), info.code) << info.name;
    EXPECT_EQ(&info_of(info.code), &info) << info.name;
  }
  EXPECT_EQ(names.size(), static_cast<size_t>(ErrorCode::kStorageFull) + 1);
}

TEST(ErrorCode, every_code_has_the_status_of_a_failure_and_a_title) {
  for (const ErrorCodeInfo& info : all_error_codes()) {
    EXPECT_GE(info.http_status, 400) << info.name;
    EXPECT_LT(info.http_status, 600) << info.name;
    EXPECT_FALSE(info.title.empty()) << info.name;
  }
}

TEST(ErrorCode, statuses_that_clients_rely_on_stay) {
  EXPECT_EQ(info_of(ErrorCode::kUnknownOption).http_status, 400);
  EXPECT_EQ(info_of(ErrorCode::kNotFound).http_status, 404);
  EXPECT_EQ(info_of(ErrorCode::kConflict).http_status, 409);
  EXPECT_EQ(info_of(ErrorCode::kPayloadTooLarge).http_status, 413);
  EXPECT_EQ(info_of(ErrorCode::kMalformedMesh).http_status, 422);
  EXPECT_EQ(info_of(ErrorCode::kQueueFull).http_status, 503);
  EXPECT_EQ(info_of(ErrorCode::kStorageFull).http_status, 507);
}

TEST(ErrorCode, a_name_of_a_newer_server_is_internal) {
  EXPECT_EQ(error_code_from_name("flux-capacitor"), ErrorCode::kInternal);
  EXPECT_EQ(error_code_from_name(""), ErrorCode::kInternal);
  EXPECT_EQ(error_code_from_name("Not-Found"), ErrorCode::kInternal);
}

TEST(Error, the_message_joins_the_present_parts) {
  EXPECT_EQ((Error{ErrorCode::kInternal, "a", "", ""}).message(), "a");
  EXPECT_EQ((Error{ErrorCode::kInternal, "a", "b", ""}).message(), "a: expected b");
  EXPECT_EQ((Error{ErrorCode::kInternal, "a", "", "c"}).message(), "a: got c");
  EXPECT_EQ((Error{ErrorCode::kInternal, "a", "b", "c"}).message(), "a: expected b, got c");
}

Result<int> half(int value) {
  if (value % 2 != 0) return Error{ErrorCode::kInvalidOption, "odd", "", std::to_string(value)};
  return value / 2;
}
Result<int> quarter(int value) {
  VOXELD_ASSIGN(const int once, half(value));
  VOXELD_ASSIGN(const int twice, half(once));
  return twice;
}
Status is_even(int value) {
  VOXELD_TRY(half(value));
  return {};
}

TEST(Result, carries_the_value_or_the_first_error_outwards) {
  ASSERT_TRUE(quarter(12));
  EXPECT_EQ(*quarter(12), 3);
  ASSERT_FALSE(quarter(6));
  EXPECT_EQ(quarter(6).error().message(), "odd: got 3");
  EXPECT_TRUE(is_even(4));
  EXPECT_EQ(is_even(5).error().message(), "odd: got 5");
}

}  // namespace
}  // namespace voxeld
