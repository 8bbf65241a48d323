// Parts of jobs on disk: what is there after restarts and accidents.
#include "server/store/part_store.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "server/base/disk/file.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

class PartStoreTest : public ::testing::Test {
 protected:
  PartStore open() { return PartStore::open(dir_.path()).value(); }
  fs::path scratch(const std::string& text) {
    const fs::path path = dir_.path() / ("scratch-" + std::to_string(++files_));
    std::ofstream(path) << text;
    return path;
  }
  static std::vector<std::string> texts(const PartStore& store, const std::string& job) {
    std::vector<std::string> texts;
    for (const fs::path& path : store.of_job(job)) {
      const auto bytes = read_file(path).value();
      texts.emplace_back(bytes.begin(), bytes.end());
    }
    return texts;
  }
  using Texts = std::vector<std::string>;

  testing::TemporaryDir dir_;
  int files_ = 0;
  int64_t position_ = 0;
};

TEST_F(PartStoreTest, parts_come_back_in_their_order_after_a_restart) {
  const PartStore store = open();
  for (int i = 0; i < 12; ++i) {
    ASSERT_TRUE(store.add("j-1", i, 1, scratch("part " + std::to_string(i))).ok());
  }
  const Texts found = texts(open(), "j-1");
  ASSERT_EQ(found.size(), 12u);
  EXPECT_EQ(found[2], "part 2");
  EXPECT_EQ(found[11], "part 11");
  EXPECT_EQ(texts(store, "j-2"), Texts());
}

TEST_F(PartStoreTest, a_part_replaces_those_at_and_after_its_position) {
  const PartStore store = open();
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(store.add("j-1", i, 1, scratch("old")).ok());
  ASSERT_TRUE(store.add("j-1", 1, 1, scratch("new")).ok());
  EXPECT_EQ(texts(store, "j-1"), (Texts{"old", "new"}));
}

TEST_F(PartStoreTest, a_part_with_other_bytes_ends_what_is_given) {
  const PartStore store = open();
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(store.add("j-1", i, 1, scratch("abc")).ok());
  const auto paths = store.of_job("j-1");
  ASSERT_EQ(paths.size(), 3u);
  std::ofstream(paths[1]) << "abd";
  EXPECT_EQ(texts(store, "j-1"), Texts{"abc"});
  fs::remove(paths[0]);
  EXPECT_EQ(texts(store, "j-1"), Texts());
}

TEST_F(PartStoreTest, a_tile_is_found_by_its_number_over_all_parts) {
  const PartStore store = open();
  EXPECT_FALSE(store.with_tile("j-1", 0));
  for (const int64_t tiles : {3, 0, 12, 1}) {
    ASSERT_TRUE(store.add("j-1", position_++, tiles, scratch(std::to_string(tiles))).ok());
  }
  const auto found = [&](int64_t tile) -> std::string {
    const auto part = open().with_tile("j-1", tile);
    if (!part) return "none";
    const auto bytes = read_file(part->path).value();
    return std::string(bytes.begin(), bytes.end()) + " after " + std::to_string(part->first_tile);
  };
  EXPECT_EQ(found(0), "3 after 0");
  EXPECT_EQ(found(2), "3 after 0");
  EXPECT_EQ(found(3), "12 after 3");
  EXPECT_EQ(found(14), "12 after 3");
  EXPECT_EQ(found(15), "1 after 15");
  EXPECT_EQ(found(16), "none");
  EXPECT_FALSE(store.with_tile("../j-1", 0));
  fs::remove(store.of_job("j-1")[1]);  // no tile of its own, but those behind it may be others
  EXPECT_EQ(found(2), "3 after 0");
  EXPECT_EQ(found(3), "none");
}

TEST_F(PartStoreTest, the_bytes_of_the_parts_that_a_new_one_does_not_replace) {
  const PartStore store = open();
  EXPECT_EQ(store.bytes_before("j-1", 7), 0);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(store.add("j-1", i, 1, scratch("abc")).ok());
  ASSERT_TRUE(store.add("j-2", 0, 1, scratch("somebody else's")).ok());
  EXPECT_EQ(store.bytes_before("j-1", 3), 9);
  EXPECT_EQ(store.bytes_before("j-1", 1), 3);
  EXPECT_EQ(store.bytes_before("j-1", 0), 0);
  EXPECT_EQ(store.bytes_before("..", 3), 0);
}

TEST_F(PartStoreTest, the_parts_of_a_job_go_with_it) {
  const PartStore store = open();
  for (const std::string job : {"j-1", "j-2", "j-3"}) {
    ASSERT_TRUE(store.add(job, 0, 1, scratch(job)).ok());
  }
  store.remove("j-1");
  EXPECT_EQ(texts(store, "j-1"), Texts());
  store.remove_unless([](std::string_view job) { return job == "j-3"; });
  EXPECT_EQ(texts(store, "j-2"), Texts());
  EXPECT_EQ(texts(store, "j-3"), Texts{"j-3"});
  EXPECT_FALSE(fs::exists(dir_.path() / "parts" / "j-2"));
}

TEST_F(PartStoreTest, links_and_odd_names_are_refused) {
  const PartStore store = open();
  const fs::path secret = scratch("somebody else's"), link = dir_.path() / "link";
  fs::create_symlink(secret, link);
  EXPECT_EQ(store.add("j-1", 0, 1, link).error().detail, "link is not a plain file");
  fs::create_hard_link(secret, dir_.path() / "twin");
  EXPECT_FALSE(store.add("j-1", 0, 1, dir_.path() / "twin").ok());
  for (const std::string job : {"..", "", "a/b", ".hidden"}) {
    EXPECT_FALSE(store.add(job, 0, 1, scratch("x")).ok()) << job;
    EXPECT_EQ(texts(store, job), Texts());
  }
  store.remove("..");
  EXPECT_TRUE(fs::exists(secret));
}

}  // namespace
}  // namespace voxeld
