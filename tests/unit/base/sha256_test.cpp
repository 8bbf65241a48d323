#include "server/base/sha256.h"

#include <gtest/gtest.h>

#include <string>

namespace voxeld {
namespace {

// FIPS 180-4, examples.
TEST(Sha256, known_digests_match) {
  EXPECT_EQ(sha256_id("abc"),
            "sha256-ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_id(""),
            "sha256-e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(Sha256, pieces_give_the_hash_of_the_whole) {
  Sha256 hash;
  hash.update("a");
  hash.update("");
  hash.update("bc");
  EXPECT_EQ(hash.finish_id(), sha256_id("abc"));
}

TEST(Sha256, only_exact_ids_are_ids) {
  const std::string id = sha256_id("abc");
  EXPECT_TRUE(is_sha256_id(id));
  EXPECT_FALSE(is_sha256_id(id + "0"));
  EXPECT_FALSE(is_sha256_id(id.substr(0, id.size() - 1)));
  EXPECT_FALSE(is_sha256_id(id.substr(7)));
  EXPECT_FALSE(
      is_sha256_id("sha256-../../../../../../../../../../../../../../../../../etc/passwdx"));
  std::string upper = id;
  upper[7] = 'B';
  EXPECT_FALSE(is_sha256_id(upper));
  EXPECT_FALSE(is_sha256_id(""));
}

}  // namespace
}  // namespace voxeld
