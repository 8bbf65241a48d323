#include "server/jobs/auth/key_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "server/base/sha256.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

constexpr const char* kHead =
    "# voxeld keys 1: id tenant hash created_ms expires_ms revoked_ms weight role"
    " requests_per_minute queued_jobs bytes cells\n";

class KeyFileTest : public ::testing::Test {
 protected:
  std::filesystem::path file() const { return dir_.path() / "keys"; }
  void write(const std::string& text, mode_t mode = 0600) {
    std::ofstream(file(), std::ios::binary) << text;
    ASSERT_EQ(::chmod(file().c_str(), mode), 0);
  }
  static ApiKey key(const std::string& id) {
    ApiKey key;
    key.id = id;
    key.tenant = "lab";
    key.secret_hash = sha256_id("secret of " + id);
    return key;
  }
  static std::string head_line() {
    std::string head(kHead);
    head.pop_back();
    return head;
  }
  static std::string line(const std::string& id) {
    return id + " lab " + sha256_id("secret of " + id) + " 0 0 0 1 tenant 0 0 0 0\n";
  }
  testing::TemporaryDir dir_;
};

TEST_F(KeyFileTest, a_list_is_read_as_it_was_written) {
  ApiKey one = key("abcdefgh"), two = key("234567zz");
  one.created_ms = 1;
  one.expires_ms = 2;
  one.revoked_ms = 3;
  one.weight = kKeyWeightMax;
  one.is_admin = true;
  one.limits = {60, 5, 1000, 7};
  const std::string text = keys_text({one, two});
  EXPECT_EQ(text, std::string(kHead) + "abcdefgh lab " + one.secret_hash +
                      " 1 2 3 1000 admin 60 5 1000 7\n" + line("234567zz"));
  const auto keys = parse_keys(text, "keys");
  ASSERT_TRUE(keys) << keys.error().message();
  ASSERT_EQ(keys->size(), 2u);
  EXPECT_EQ(keys_text(*keys), text);
  EXPECT_TRUE((*keys)[0].is_admin);
  EXPECT_FALSE((*keys)[1].is_admin);
  EXPECT_EQ((*keys)[0].expires_ms, 2);
}

TEST_F(KeyFileTest, limits_and_weight_are_those_of_the_newest_key) {
  ApiKey old = key("abcdefgh"), now = key("bbcdefgh"), revoked = key("cbcdefgh");
  old.created_ms = 1;
  now.created_ms = 2;
  revoked.created_ms = 3;
  revoked.revoked_ms = 4;
  const KeyList keys = {now, old, revoked};
  EXPECT_EQ(newest_key(keys, "lab", 10)->id, now.id);
  EXPECT_EQ(newest_key(keys, "other", 10), nullptr);
}

TEST_F(KeyFileTest, no_file_is_no_list_and_a_head_alone_is_an_empty_one) {
  EXPECT_FALSE(read_keys(file()).value().has_value());
  write(kHead);
  EXPECT_TRUE(read_keys(file()).value().value().empty());
}

TEST_F(KeyFileTest, errors_name_the_line_and_the_expected_value) {
  const std::string hash = sha256_id("x");
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "keys line 1: it ends here: expected a line feed, got \"\""},
      {"x\n", "keys line 1: head: expected " + head_line() + ", got \"x\""},
      {kHead + line("abcdefgh") + "abc",
       "keys line 3: it ends here: expected a line feed, got \"abc\""},
      {std::string(kHead) + "\n",
       "keys line 2: fields: expected 12 between single spaces, got \"\""},
      {std::string(kHead) + "a b c\n",
       "keys line 2: fields: expected 12 between single spaces, got \"a b c\""},
      {std::string(kHead) + "abcdefg1 lab " + hash + " 0 0 0 1 tenant 0 0 0 0\n",
       "keys line 2: id: expected 8 of a-z and 2-7, got \"abcdefg1\""},
      {std::string(kHead) + "abcdefgh Lab " + hash + " 0 0 0 1 tenant 0 0 0 0\n",
       "keys line 2: tenant: expected a tenant's name, got \"Lab\""},
      {std::string(kHead) + "abcdefgh lab sha256-0 0 0 0 1 tenant 0 0 0 0\n",
       "keys line 2: hash: expected sha256- and 64 hex digits, got \"sha256-0\""},
      {std::string(kHead) + "abcdefgh lab " + hash + " 0 -1 0 1 tenant 0 0 0 0\n",
       "keys line 2: expires_ms: expected 0 to 9007199254740992, got \"-1\""},
      {std::string(kHead) + "abcdefgh lab " + hash + " 0 0 0 0 tenant 0 0 0 0\n",
       "keys line 2: weight: expected 1 to 1000, got \"0\""},
      {std::string(kHead) + "abcdefgh lab " + hash + " 0 0 0 1 root 0 0 0 0\n",
       "keys line 2: role: expected tenant or admin, got \"root\""},
      {std::string(kHead) + "abcdefgh lab " + hash + " 0 0 0 1 admin 0 0 0 0 x\n",
       "keys line 2: cells: expected 0 to 9007199254740992, got \"0 x\""},
      {std::string(kHead) + "abcdefgh lab " + hash + " 0 0 0 1 tenant -1 0 0 0\n",
       "keys line 2: requests_per_minute: expected 0 to 60000000, got \"-1\""},
      {kHead + line("abcdefgh") + line("abcdefgh"),
       "keys line 3: id: expected one that no line before has, got \"abcdefgh\""}};
  for (const auto& [text, message] : cases) {
    const auto keys = parse_keys(text, "keys");
    ASSERT_FALSE(keys) << text;
    EXPECT_EQ(keys.error().message(), message);
  }
}

TEST_F(KeyFileTest, every_truncation_but_that_at_a_line_is_refused) {
  const std::string text = keys_text({key("abcdefgh"), key("bbcdefgh")});
  for (size_t bytes = 0; bytes < text.size(); ++bytes) {
    const std::string part = text.substr(0, bytes);
    EXPECT_EQ(parse_keys(part, "keys").ok(), part.ends_with('\n')) << bytes;
  }
}

TEST_F(KeyFileTest, a_file_that_others_may_write_or_that_is_none_is_refused) {
  write(kHead, 0620);
  EXPECT_EQ(read_keys(file()).error().message(),
            file().string() +
                " is open to other users; look what they made of it, then run chmod go-rwx " +
                file().string() + ": expected no permission for group and others, got mode 0620");
  write(kHead, 0640);
  EXPECT_NE(read_keys(file()).error().detail.find("chmod go-rwx"), std::string::npos);
  std::filesystem::remove(file());
  std::filesystem::create_directory(file());
  EXPECT_FALSE(read_keys(file()));
}

TEST_F(KeyFileTest, a_change_replaces_the_file_and_nobody_else_can_read_it) {
  const auto data = dir_.path() / "new" / "data";
  ASSERT_TRUE(change_keys(data, [](KeyList& keys) -> Status {
    EXPECT_TRUE(keys.empty());
    keys.push_back(key("abcdefgh"));
    return {};
  }));
  struct stat info {};
  ASSERT_EQ(::stat(key_file_path(data).c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0600u);
  ASSERT_EQ(::stat(data.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0700u);
  const Status failed = change_keys(data, [](KeyList& keys) -> Status {
    keys.clear();
    return Error{ErrorCode::kInvalidOption, "no", "", ""};
  });
  EXPECT_EQ(failed.error().detail, "no");
  EXPECT_EQ(read_keys(key_file_path(data)).value()->size(), 1u);
}

TEST_F(KeyFileTest, concurrent_changes_are_all_stored) {
  constexpr int kThreads = 4, kKeys = 5;
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < kKeys; ++i) {
        EXPECT_TRUE(change_keys(dir_.path(), [](KeyList& keys) -> Status {
          keys.push_back(key(make_key_secret().id));
          return {};
        }));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(read_keys(file()).value()->size(), size_t{kThreads} * kKeys);
}

}  // namespace
}  // namespace voxeld
