#include "server/jobs/auth/url_secret.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "server/base/sha256.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

TEST(Hmac, matches_the_vectors_of_rfc_4231) {
  EXPECT_EQ(hmac_sha256("Jefe", "what do ya want for nothing?"),
            "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
  EXPECT_EQ(hmac_sha256(std::string(20, '\x0b'), "Hi There"),
            "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7");
}

TEST(UrlSecrets, are_made_once_and_readable_only_by_the_owner) {
  const testing::TemporaryDir dir;
  const auto first = UrlSecrets::open(dir.path()).value();
  const auto again = UrlSecrets::open(dir.path()).value();
  const std::string signature = first->sign("text").value();
  EXPECT_EQ(again->sign("text").value(), signature);
  EXPECT_TRUE(first->verify("text", signature));
  EXPECT_FALSE(first->verify("texT", signature));
  EXPECT_FALSE(first->verify("text", signature.substr(1)));
  EXPECT_FALSE(first->verify("text", ""));
  namespace fs = std::filesystem;
  EXPECT_EQ(fs::status(dir.path() / "url_secret").permissions(),
            fs::perms::owner_read | fs::perms::owner_write);
}

TEST(UrlSecrets, a_signature_outlives_one_rotation_and_not_two) {
  const testing::TemporaryDir dir;
  const auto secrets = UrlSecrets::open(dir.path()).value();
  const std::string old = secrets->sign("text").value();
  ASSERT_TRUE(rotate_url_secret(dir.path()));
  EXPECT_TRUE(secrets->verify("text", old));
  const std::string now = secrets->sign("text").value();
  EXPECT_NE(now, old);
  ASSERT_TRUE(rotate_url_secret(dir.path()));
  EXPECT_FALSE(secrets->verify("text", old));
  EXPECT_TRUE(secrets->verify("text", now));
}

TEST(UrlSecrets, a_file_that_is_none_signs_and_verifies_nothing) {
  const testing::TemporaryDir dir;
  const auto secrets = UrlSecrets::open(dir.path()).value();
  const std::string signature = secrets->sign("text").value();
  std::ofstream(dir.path() / "url_secret") << "broken\n";
  EXPECT_FALSE(secrets->verify("text", signature));
  EXPECT_FALSE(secrets->sign("text"));
  EXPECT_FALSE(UrlSecrets::open(dir.path()));
  const std::string good(64, 'a');
  EXPECT_EQ(parse_url_secrets(good + "\n", "f").value().size(), 1u);
  EXPECT_EQ(parse_url_secrets(good + "\n" + good + "\n", "f").value().size(), 2u);
  for (const std::string& text :
       {std::string(), good, good + "\n" + good, "g" + good.substr(1) + "\n",
        good + "\n" + good + "\n" + good + "\n", good + "a\n"}) {
    EXPECT_FALSE(parse_url_secrets(text, "f")) << text;
  }
}

}  // namespace
}  // namespace voxeld
