#include "server/base/directory.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "server/base/guard.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

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

TEST(Guard, an_exception_ends_only_the_guarded_call) {
  EXPECT_TRUE(guarded("a test", [] {}));
  EXPECT_FALSE(guarded("a test", [] { throw std::bad_alloc(); }));
  EXPECT_EQ(exception_error(std::bad_alloc()).detail, "std::bad_alloc");
}

}  // namespace
}  // namespace voxeld
