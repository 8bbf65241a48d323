#include "server/jobs/auth/key_ring.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>
#include <fstream>
#include <string>
#include <thread>

#include "server/base/clock.h"
#include "server/jobs/auth/key_file.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

class KeyRingTest : public ::testing::Test {
 protected:
  // Returns the key's text.
  std::string add(const std::string& tenant, bool is_admin = false, int64_t expires_ms = 0) {
    const KeySecret secret = make_key_secret();
    EXPECT_TRUE(change_keys(dir_.path(), [&](KeyList& keys) -> Status {
      ApiKey key;
      key.id = secret.id;
      key.tenant = tenant;
      key.secret_hash = secret.hash();
      key.expires_ms = expires_ms;
      key.is_admin = is_admin;
      keys.push_back(key);
      return {};
    }));
    return secret.text();
  }
  void revoke(const std::string& text) {
    EXPECT_TRUE(change_keys(dir_.path(), [&](KeyList& keys) -> Status {
      for (ApiKey& key : keys) {
        if (key.id == split_key(text).id) key.revoked_ms = 1;
      }
      return {};
    }));
  }
  // With every call looking at the file.
  std::unique_ptr<KeyRing> open(std::chrono::milliseconds check_interval = {}) {
    auto ring = KeyRing::open(dir_.path(), check_interval);
    EXPECT_TRUE(ring) << ring.error().message();
    return *std::move(ring);
  }
  testing::TemporaryDir dir_;
};

TEST_F(KeyRingTest, without_a_file_everybody_is_the_tenant_of_the_open_daemon) {
  const auto ring = open();
  EXPECT_FALSE(ring->needs_keys());
  for (const char* text : {"", "anything"}) {
    const auto holder = ring->admit(text);
    ASSERT_TRUE(holder);
    EXPECT_EQ(holder->caller.tenant(), "");
    EXPECT_FALSE(holder->caller.sees_all());
    EXPECT_EQ(holder->key_id, "");
  }
  EXPECT_TRUE(ring->is_live(""));
}

TEST_F(KeyRingTest, a_key_gives_its_tenant_and_admin_right) {
  const std::string lab = add("lab"), second = add("lab"), boss = add("boss", true);
  const auto ring = open();
  EXPECT_TRUE(ring->needs_keys());
  for (const std::string& text : {lab, second}) {
    const auto holder = ring->admit(text);
    ASSERT_TRUE(holder);
    EXPECT_EQ(holder->caller.tenant(), "lab");
    EXPECT_FALSE(holder->caller.sees_all());
    EXPECT_EQ(holder->key_id, split_key(text).id);
  }
  ASSERT_TRUE(ring->admit(boss));
  EXPECT_EQ(ring->admit(boss)->caller.tenant(), "boss");
  EXPECT_TRUE(ring->admit(boss)->caller.sees_all());
}

TEST_F(KeyRingTest, the_weight_of_a_tenant_is_that_of_its_newest_live_key) {
  const std::string first = add("lab"), second = add("lab");
  EXPECT_TRUE(change_keys(dir_.path(), [](KeyList& keys) -> Status {
    keys[0].weight = 9;
    keys[1].weight = 3;
    return {};
  }));
  const auto ring = open();
  EXPECT_EQ(ring->weight_of("lab"), 3);
  EXPECT_EQ(ring->weight_of("nobody"), 1);
  revoke(second);
  EXPECT_EQ(ring->weight_of("lab"), 9);
  revoke(first);
  EXPECT_EQ(ring->weight_of("lab"), 1);
}

TEST_F(KeyRingTest, limits_of_a_tenant_stay_those_of_its_newest_key_where_none_is_live) {
  const std::string first = add("lab"), second = add("lab");
  EXPECT_TRUE(change_keys(dir_.path(), [](KeyList& keys) -> Status {
    keys[0].limits.cells = 7;
    keys[1].limits.cells = 5;
    return {};
  }));
  const auto ring = open();
  EXPECT_EQ(ring->limits_of("lab").cells, 5);
  revoke(second);
  EXPECT_EQ(ring->limits_of("lab").cells, 7);
  revoke(first);
  EXPECT_EQ(ring->limits_of("lab").cells, 5) << "its jobs may still wait";
  EXPECT_EQ(ring->limits_of("nobody").cells, 0);
}

TEST_F(KeyRingTest, keys_that_are_wrong_malformed_unknown_or_expired_are_not_admitted) {
  const std::string good = add("lab"), other = add("other");
  const std::string expired = add("lab", false, unix_time_ms() - 1);
  const auto ring = open();
  std::string wrong = good;
  wrong.back() = wrong.back() == 'a' ? 'q' : 'a';
  const std::string mixed =
      "vxk_" + std::string(split_key(good).id) + "_" + std::string(split_key(other).secret);
  for (const std::string& text : {std::string(), std::string("vxk_"), wrong, mixed, expired,
                                  make_key_secret().text(), good.substr(1), good + "a"}) {
    EXPECT_FALSE(ring->admit(text)) << text;
  }
  EXPECT_TRUE(ring->admit(good));
  EXPECT_FALSE(ring->is_live(split_key(expired).id));
  EXPECT_FALSE(ring->is_live(""));
}

TEST_F(KeyRingTest, added_and_revoked_keys_count_at_once) {
  const auto ring = open();
  const std::string first = add("lab");
  EXPECT_FALSE(ring->admit("")) << "the daemon is open no more";
  EXPECT_TRUE(ring->admit(first));
  const std::string second = add("lab");
  EXPECT_TRUE(ring->admit(second));
  revoke(first);
  EXPECT_FALSE(ring->admit(first));
  EXPECT_FALSE(ring->is_live(split_key(first).id));
  EXPECT_TRUE(ring->admit(second));
  revoke(second);
  EXPECT_FALSE(ring->admit("")) << "without any live key it does not become open";
  EXPECT_TRUE(open()->needs_keys());
}

TEST_F(KeyRingTest, within_the_interval_new_keys_count_and_revoked_ones_still_do) {
  const std::string first = add("lab");
  const auto ring = open(std::chrono::hours(1));
  EXPECT_TRUE(ring->admit(first));
  const std::string second = add("lab");
  EXPECT_TRUE(ring->admit(second)) << "before it is refused the file is read";
  revoke(first);
  EXPECT_TRUE(ring->admit(first));
  EXPECT_TRUE(ring->is_live(split_key(first).id));
  EXPECT_FALSE(ring->admit("unknown"));
  EXPECT_FALSE(ring->admit(first)) << "the refusal has read the file";
}

TEST_F(KeyRingTest, after_the_interval_a_revoked_key_is_refused) {
  const std::string key = add("lab");
  const auto ring = open(std::chrono::milliseconds(1));
  EXPECT_TRUE(ring->admit(key));
  revoke(key);
  std::this_thread::sleep_for(std::chrono::milliseconds(2));
  EXPECT_FALSE(ring->admit(key));
}

TEST_F(KeyRingTest, a_file_that_cannot_be_opened_for_a_moment_is_read_again) {
  const std::string key = add("lab"), revoked = add("lab");
  const auto ring = open();
  ASSERT_TRUE(ring->admit(key) && ring->admit(revoked));
  revoke(revoked);
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlimit none{0, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const bool is_admitted = ring->admit(key) || ring->admit(revoked);
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
  EXPECT_FALSE(is_admitted);
  EXPECT_TRUE(ring->admit(key));
  EXPECT_FALSE(ring->admit(revoked));
  EXPECT_TRUE(ring->status());
}

TEST_F(KeyRingTest, a_file_that_breaks_or_goes_while_the_daemon_runs_admits_nobody) {
  const std::string key = add("lab");
  const auto ring = open();
  const std::string text = keys_text(*read_keys(key_file_path(dir_.path())).value());
  std::ofstream(key_file_path(dir_.path())) << "broken\n";
  EXPECT_FALSE(ring->admit(key));
  EXPECT_FALSE(ring->admit(""));
  EXPECT_NE(ring->status().error().detail.find("line 1"), std::string::npos);
  std::filesystem::remove(key_file_path(dir_.path()));
  EXPECT_FALSE(ring->admit(""));
  EXPECT_TRUE(ring->needs_keys());
  EXPECT_NE(ring->status().error().detail.find("is gone"), std::string::npos);
  std::ofstream(key_file_path(dir_.path())) << text;
  std::filesystem::permissions(key_file_path(dir_.path()), std::filesystem::perms::owner_all);
  EXPECT_TRUE(ring->admit(key));
  EXPECT_TRUE(ring->status());
}

TEST_F(KeyRingTest, a_broken_file_is_refused_at_start_with_its_line) {
  add("lab");
  std::ofstream(key_file_path(dir_.path()), std::ios::app) << "half a li";
  const auto ring = KeyRing::open(dir_.path());
  ASSERT_FALSE(ring);
  EXPECT_EQ(ring.error().message(), key_file_path(dir_.path()).string() +
                                        " line 3: it ends here: expected a line feed, got "
                                        "\"half a li\"");
}

}  // namespace
}  // namespace voxeld
