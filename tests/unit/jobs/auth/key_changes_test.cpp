// Changes of the key file that the command line and the API share.
#include "server/jobs/auth/key_changes.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "server/jobs/auth/key_file.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

class KeyChangesTest : public ::testing::Test {
 protected:
  AddedKey add(const std::string& tenant, bool is_admin = false, KeySettings settings = {}) {
    auto added = add_key(dir_.path(), {tenant, is_admin, "", std::move(settings)});
    EXPECT_TRUE(added) << added.error().message();
    return *std::move(added);
  }
  KeyList keys() const { return read_keys(key_file_path(dir_.path())).value().value(); }
  testing::TemporaryDir dir_;
};

KeySettings with_rate(const std::string& rate) {
  KeySettings settings;
  settings.rate = rate;
  return settings;
}

TEST_F(KeyChangesTest, an_added_key_is_in_the_file_by_the_hash_of_its_secret) {
  const AddedKey added = add("lab", true, with_rate("10/s"));
  const PresentedKey parts = split_key(added.secret_text);
  EXPECT_EQ(parts.id, added.key.id);
  ASSERT_EQ(keys().size(), 1u);
  EXPECT_EQ(keys_text(keys()), keys_text({added.key}));
  EXPECT_TRUE(added.key.is_admin);
  EXPECT_EQ(added.key.limits.requests_per_minute, 600);
  EXPECT_EQ(keys_text(keys()).find(parts.secret), std::string::npos);
}

TEST_F(KeyChangesTest, a_new_key_takes_the_limits_of_its_tenant_but_for_those_given) {
  KeySettings first = with_rate("10/s");
  first.weight = 3;
  first.bytes = 1000;
  add("lab", false, first);
  const ApiKey second = add("lab", false, with_rate("0")).key;
  EXPECT_EQ(second.weight, 3);
  EXPECT_EQ(second.limits, (TenantLimits{0, 0, 1000, 0}));
  EXPECT_EQ(add("other").key.limits, TenantLimits{});
}

TEST_F(KeyChangesTest, settings_apply_to_all_keys_of_the_tenant_and_to_no_others) {
  const ApiKey one = add("lab").key, two = add("lab").key, other = add("other").key;
  KeySettings settings;
  settings.cells = 7;
  const auto changed = set_key_limits(dir_.path(), one.id, settings);
  ASSERT_TRUE(changed);
  EXPECT_EQ(changed->id, one.id);
  EXPECT_EQ(changed->limits.cells, 7);
  ASSERT_EQ(keys().size(), 3u);
  for (const ApiKey& key : keys()) EXPECT_EQ(key.limits.cells, key.tenant == "lab" ? 7 : 0);
}

TEST_F(KeyChangesTest, wrong_values_are_refused_with_their_range_and_change_nothing) {
  const ApiKey key = add("lab").key;
  const auto refused = [&](KeySettings settings) {
    return set_key_limits(dir_.path(), key.id, settings).error().message();
  };
  EXPECT_EQ(refused({.weight = 0}), "weight: expected 1 to 1000, got 0");
  EXPECT_EQ(refused({.weight = 1001}), "weight: expected 1 to 1000, got 1001");
  EXPECT_EQ(refused({.queued_jobs = -1}), "queued_jobs: expected 0 to 1000000000, got -1");
  EXPECT_EQ(refused({.bytes = -1}), "bytes: expected 0 to 9007199254740992, got -1");
  EXPECT_EQ(refused({.weight = 2, .cells = -1}), "cells: expected 0 to 9007199254740992, got -1");
  EXPECT_EQ(refused(with_rate("fast")),
            "rate: expected requests per second (10 or 10/s) or minute (30/m), got \"fast\"");
  EXPECT_EQ(add_key(dir_.path(), {"Two Words", false, "", {}}).error().code,
            ErrorCode::kInvalidOption);
  EXPECT_EQ(add_key(dir_.path(), {"lab", false, "soon", {}}).error().code,
            ErrorCode::kInvalidOption);
  EXPECT_EQ(keys_text(keys()), keys_text({key}));
}

TEST_F(KeyChangesTest, a_key_is_revoked_once) {
  const ApiKey key = add("lab").key;
  const auto first = revoke_key(dir_.path(), key.id, LastAdmin::kStays);
  ASSERT_TRUE(first);
  EXPECT_GT(first->revoked_ms, 0);
  const auto again = revoke_key(dir_.path(), key.id, LastAdmin::kStays);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->revoked_ms, first->revoked_ms);
}

TEST_F(KeyChangesTest, the_last_live_key_of_an_admin_stays_unless_it_may_go) {
  const ApiKey first = add("boss", true).key, second = add("boss", true).key;
  add("lab");
  EXPECT_TRUE(revoke_key(dir_.path(), first.id, LastAdmin::kStays));
  const auto refused = revoke_key(dir_.path(), second.id, LastAdmin::kStays);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kConflict);
  EXPECT_NE(refused.error().message().find("voxeld keys revoke"), std::string::npos);
  EXPECT_TRUE(revoke_key(dir_.path(), first.id, LastAdmin::kStays)) << "it is revoked already";
  EXPECT_TRUE(revoke_key(dir_.path(), second.id, LastAdmin::kMayGo));
}

TEST_F(KeyChangesTest, an_unknown_id_is_not_found_and_a_whole_key_is_not_repeated) {
  const std::string text = add("lab").secret_text;
  for (const std::string& id : {std::string("aaaaaaaa"), text, std::string()}) {
    for (const auto& result :
         {revoke_key(dir_.path(), id, LastAdmin::kMayGo), set_key_limits(dir_.path(), id, {})}) {
      ASSERT_FALSE(result) << id;
      EXPECT_EQ(result.error().code, ErrorCode::kNotFound);
      EXPECT_EQ(result.error().message().find(text), std::string::npos);
    }
  }
}

TEST(KeyJson, has_all_of_a_key_but_its_hash) {
  ApiKey key;
  key.id = "abcdefgh";
  key.tenant = "lab";
  key.secret_hash = "sha256-0";
  key.created_ms = 1;
  key.expires_ms = 100;
  key.limits = {60, 5, 1000, 7};
  EXPECT_EQ(key_json(key, 99).dump(),
            R"({"admin":false,"created_ms":1,"expires_ms":100,"id":"abcdefgh",)"
            R"("limits":{"bytes":1000,"cells":7,"queued_jobs":5,"requests_per_minute":60},)"
            R"("name":"lab","revoked_ms":0,"state":"live","weight":1})");
  EXPECT_EQ(key_state(key, 100), "expired");
  key.revoked_ms = 5;
  EXPECT_EQ(key_state(key, 100), "revoked");
}

}  // namespace
}  // namespace voxeld
