#include "server/base/disk/directory.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "server/base/disk/file.h"
#include "server/base/guard.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kHiddenBytes = int64_t{1} << 20;

// A file of kHiddenBytes below so many folders, each in the one before: at 3000 of them no path
// reaches it.
void hide_file(const fs::path& tree, int depth) {
  ASSERT_TRUE(fs::create_directory(tree));
  UniqueFd folder(::open(tree.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  for (int level = 0; level < depth; ++level) {
    ASSERT_EQ(::mkdirat(folder.get(), "n", 0700), 0);
    folder = UniqueFd(::openat(folder.get(), "n", O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    ASSERT_TRUE(folder.valid());
  }
  const UniqueFd file(::openat(folder.get(), "file", O_WRONLY | O_CREAT | O_CLOEXEC, 0600));
  const std::vector<uint8_t> bytes(kHiddenBytes, 7);
  ASSERT_TRUE(write_all(file.get(), bytes).ok());
}

TEST(Directory, bytes_below_any_number_of_folders_are_measured) {
  const testing::TemporaryDir dir;
  for (const int depth : {0, 1, 45, 3000}) {
    const fs::path tree = dir.path() / std::to_string(depth);
    hide_file(tree, depth);
    const auto bytes = tree_bytes(tree);
    ASSERT_TRUE(bytes) << bytes.error().message();
    EXPECT_GE(*bytes, kHiddenBytes) << depth;
    remove_tree(tree);
  }
  EXPECT_EQ(tree_bytes(dir.path() / "nowhere").value(), 0);
  EXPECT_FALSE(tree_bytes("/dev/null"));
}

TEST(Directory, all_branches_of_a_tree_are_measured_and_links_are_not_followed) {
  const testing::TemporaryDir dir;
  hide_file(dir.path() / "outside", 0);
  const fs::path tree = dir.path() / "tree";
  hide_file(tree, 3);
  for (const char* branch : {"a", "n/b", "n/n/c"}) hide_file(tree / branch, 2);
  fs::create_directory_symlink(dir.path() / "outside", tree / "link");
  const int64_t bytes = tree_bytes(tree).value();
  EXPECT_GE(bytes, 4 * kHiddenBytes);
  EXPECT_LT(bytes, 5 * kHiddenBytes);
}

TEST(Directory, folders_without_permissions_are_measured_and_removed) {
  const testing::TemporaryDir dir;
  const fs::path tree = dir.path() / "tree";
  hide_file(tree, 3);
  for (const char* closed : {"n/n", "n", "."}) ASSERT_EQ(::chmod((tree / closed).c_str(), 0), 0);
  EXPECT_GE(tree_bytes(tree).value(), kHiddenBytes);
  for (const char* closed : {"n/n", "n", "."}) ASSERT_EQ(::chmod((tree / closed).c_str(), 0), 0);
  remove_tree(tree);
  EXPECT_FALSE(fs::exists(tree));
}

TEST(Directory, more_entries_than_the_limit_are_an_error) {
  const testing::TemporaryDir dir;
  for (int64_t i = 0; i <= kTreeEntriesMax; ++i) {
    const std::string path = dir.path() / std::to_string(i);
    ASSERT_EQ(::mknod(path.c_str(), S_IFREG | 0600, 0), 0);
  }
  const auto bytes = tree_bytes(dir.path());
  ASSERT_FALSE(bytes);
  EXPECT_TRUE(bytes.error().message().starts_with("too many files in ")) << bytes.error().message();
  ASSERT_TRUE(fs::remove(dir.path() / "0"));
  EXPECT_TRUE(tree_bytes(dir.path()));
}

TEST(Directory, names_are_those_of_files_and_folders) {
  const testing::TemporaryDir dir;
  fs::create_directory(dir.path() / "folder");
  std::ofstream(dir.path() / "file") << "x";
  auto names = directory_names(dir.path()).value();
  std::ranges::sort(names);
  EXPECT_EQ(names, (std::vector<std::string>{"file", "folder"}));
  EXPECT_TRUE(directory_names(dir.path() / "nowhere").value().empty());
  EXPECT_FALSE(directory_names(dir.path() / "file"));
}

TEST(Directory, a_tree_is_removed_and_links_are_not_followed) {
  const testing::TemporaryDir dir;
  fs::create_directories(dir.path() / "tree/a/b");
  std::ofstream(dir.path() / "tree/a/b/file") << "x";
  std::ofstream(dir.path() / "outside") << "x";
  fs::create_directory_symlink(dir.path(), dir.path() / "tree/link");
  remove_tree(dir.path() / "tree");
  EXPECT_FALSE(fs::exists(dir.path() / "tree"));
  EXPECT_TRUE(fs::exists(dir.path() / "outside"));
  remove_tree(dir.path() / "nowhere");
}

TEST(Directory, a_tree_of_any_depth_is_removed) {
  const testing::TemporaryDir dir;
  for (const int depth : {45, 3000}) {
    const fs::path tree = dir.path() / "tree";
    hide_file(tree, depth);
    // Names that the removal gives itself.
    hide_file(tree / "removed-0", 40);
    hide_file(tree / "n/removed-1", 2);
    std::ofstream(tree / "removed-2") << "x";
    remove_tree(tree);
    EXPECT_FALSE(fs::exists(tree)) << depth;
  }
}

TEST(Guard, an_exception_ends_only_the_guarded_call) {
  EXPECT_TRUE(guarded("a test", [] {}));
  EXPECT_FALSE(guarded("a test", [] { throw std::bad_alloc(); }));
  EXPECT_EQ(exception_error(std::bad_alloc()).detail, "std::bad_alloc");
}

TEST(Directory, a_tree_goes_though_files_are_created_in_it_meanwhile) {
  const testing::TemporaryDir dir;
  const fs::path tree = dir.path() / "tree";
  ASSERT_TRUE(fs::create_directories(tree / "out"));
  std::thread writer([&] {  // ends within the tries of remove_tree() on a slow machine, too
    for (int i = 0; i < 500; ++i) std::ofstream(tree / "out" / std::to_string(i)) << i;
  });
  remove_tree(tree);
  writer.join();
  EXPECT_FALSE(fs::exists(tree));
}

}  // namespace
}  // namespace voxeld
