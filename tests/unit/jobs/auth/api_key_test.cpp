#include "server/jobs/auth/api_key.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "server/base/sha256.h"

namespace voxeld {
namespace {

constexpr int64_t kExpiryHourMs = 3600 * 1000;
constexpr int64_t kNowMs = 1'763'778'000'000;  // 2025-11-22 02:20 UTC

TEST(ApiKey, a_new_key_has_256_random_bits_and_comes_apart_again) {
  std::set<std::string> texts;
  for (int i = 0; i < 100; ++i) {
    const KeySecret secret = make_key_secret();
    const std::string text = secret.text();
    EXPECT_EQ(text.size(), 4u + 8u + 1u + 52u);
    const PresentedKey parts = split_key(text);
    EXPECT_EQ(parts.id, secret.id);
    EXPECT_EQ(parts.secret, secret.secret);
    EXPECT_EQ(secret.hash(), sha256_id(parts.secret));
    texts.insert(text);
  }
  EXPECT_EQ(texts.size(), 100u);
}

TEST(ApiKey, an_invalid_key_has_no_parts) {
  const std::string secret(52, 'a');
  EXPECT_EQ(split_key("vxk_abcdefgh_" + secret).secret, secret);
  for (const std::string& text :
       {std::string(), std::string("vxk_"), "vxk_abcdefgh" + secret, "vxk_abcdefgh_" + secret + "a",
        "vxk_abcdefgh_" + secret.substr(1), "vxk_abcdefg_" + secret, "vxk_abcdefg1_" + secret,
        "vxk_ABCDEFGH_" + secret, "VXK_abcdefgh_" + secret, " vxk_abcdefgh_" + secret,
        "vxk_abcdefgh_" + secret + "\n", "vxk_abcdefgh__" + secret.substr(1)}) {
    EXPECT_TRUE(split_key(text).id.empty() && split_key(text).secret.empty()) << text;
  }
}

TEST(ApiKey, texts_are_equal_when_all_of_their_bytes_are) {
  EXPECT_TRUE(equal_in_constant_time("", ""));
  EXPECT_TRUE(equal_in_constant_time("abc", "abc"));
  EXPECT_FALSE(equal_in_constant_time("abc", "abd"));
  EXPECT_FALSE(equal_in_constant_time("bbc", "abc"));
  EXPECT_FALSE(equal_in_constant_time("abc", "ab"));
}

TEST(ApiKey, a_key_lives_until_it_expires_or_is_revoked) {
  ApiKey key;
  EXPECT_TRUE(key.is_live(kNowMs));
  key.expires_ms = kNowMs + 1;
  EXPECT_TRUE(key.is_live(kNowMs));
  EXPECT_FALSE(key.is_live(kNowMs + 1));
  key.expires_ms = 0;
  key.revoked_ms = kNowMs;
  EXPECT_FALSE(key.is_live(kNowMs));
}

TEST(ApiKey, names_of_tenants_are_plain) {
  for (const char* name : {"a", "lab-3", "jane.doe", "0", "a_b"}) {
    EXPECT_TRUE(check_tenant_name(name)) << name;
  }
  EXPECT_TRUE(check_tenant_name(std::string(64, 'x')));
  for (const std::string& name :
       {std::string(), std::string("-"), std::string(".hidden"), std::string("A"),
        std::string("two words"), std::string("a\nb"), std::string(65, 'x'), std::string("ä")}) {
    const Status refused = check_tenant_name(name);
    ASSERT_FALSE(refused) << name;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidOption);
  }
}

TEST(ApiKey, an_expiry_is_a_time_from_now_or_a_day) {
  EXPECT_EQ(parse_expiry("1h", kNowMs).value(), kNowMs + kExpiryHourMs);
  EXPECT_EQ(parse_expiry("30d", kNowMs).value(), kNowMs + 30 * 24 * kExpiryHourMs);
  EXPECT_EQ(parse_expiry("2w", kNowMs).value(), kNowMs + 14 * 24 * kExpiryHourMs);
  EXPECT_EQ(parse_expiry("2026-01-01", kNowMs).value(), 1'767'225'600'000);
  EXPECT_EQ(parse_expiry("2028-02-29", kNowMs).value(), 1'835'395'200'000);
}

TEST(ApiKey, an_expiry_that_is_none_or_past_is_refused_with_what_was_expected) {
  for (const char* text : {"", "d", "0d", "-1d", "30", "1.5d", "1m", "d30", "99999999999999999999d",
                           "900000d", "2025-11-22", "2020-01-01", "2027-02-29", "2026-13-01",
                           "2026-1-1", "2026/01/01", "9999-01-01", "2026-01-01T00:00"}) {
    const auto refused = parse_expiry(text, kNowMs);
    ASSERT_FALSE(refused) << text;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidOption);
    EXPECT_EQ(refused.error().message(),
              "expires: expected a time from now (12h, 30d, 8w; at most 100 years) or a day to "
              "come (2030-12-31), got \"" +
                  std::string(text) + "\"");
  }
}

}  // namespace
}  // namespace voxeld
