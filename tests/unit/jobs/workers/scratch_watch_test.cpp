#include "server/jobs/workers/scratch_watch.h"

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "server/base/disk/directory.h"
#include "tests/unit/base/comes_true.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kMegabyte = int64_t{1} << 20;

// Below more folders than a walk that calls itself would enter.
void hide_megabytes(const fs::path& folder, size_t count) {
  fs::path at = folder;
  for (int i = 0; i < 45; ++i) at /= "n";
  fs::create_directories(at);
  std::ofstream(at / "file") << std::string(count * kMegabyte, 'x');
}

TEST(ScratchWatch, bytes_below_45_folders_count_towards_the_limit) {
  const testing::TemporaryDir dir;
  const std::vector<fs::path> folders{dir.path() / "out", dir.path() / "cache"};
  hide_megabytes(folders[0], 2);
  hide_megabytes(folders[1], 2);
  EXPECT_TRUE(check_scratch(folders, 5 * kMegabyte).ok());
  EXPECT_TRUE(check_scratch(folders, 0).ok()) << "no limit";
  const Status over = check_scratch(folders, 3 * kMegabyte);
  ASSERT_FALSE(over);
  EXPECT_EQ(over.error().code, ErrorCode::kStorageFull);
  EXPECT_EQ(over.error().detail, "the job writes more than one worker may");
}

TEST(ScratchWatch, what_cannot_be_measured_is_over_the_limit) {
  const testing::TemporaryDir dir;
  for (int64_t i = 0; i <= kTreeEntriesMax; ++i) {
    std::ofstream(dir.path() / std::to_string(i)).flush();
  }
  const Status over = check_scratch({dir.path()}, int64_t{1} << 40);
  ASSERT_FALSE(over);
  EXPECT_EQ(over.error().code, ErrorCode::kStorageFull);
  EXPECT_TRUE(over.error().detail.starts_with("what the job writes cannot be measured: too many "))
      << over.error().detail;
}

TEST(ScratchWatch, a_worker_that_hides_bytes_is_condemned_and_others_are_not) {
  const testing::TemporaryDir dir;
  const std::vector<WatchedScratch> workers{{1, "hides", {dir.path() / "a"}},
                                            {2, "honest", {dir.path() / "b"}}};
  hide_megabytes(dir.path() / "a", 2);
  fs::create_directory(dir.path() / "b");
  DiskRoom disk(dir.path(), 0);
  std::atomic<int> looks = 0, condemned = 0;
  const ScratchWatch watch(kMegabyte, disk,
                           {.workers =
                                [&] {
                                  ++looks;
                                  return workers;
                                },
                            .condemned =
                                [&](const WatchedScratch& worker, const Error& error) {
                                  EXPECT_EQ(worker.task, "hides");
                                  EXPECT_EQ(error.code, ErrorCode::kStorageFull);
                                  ++condemned;
                                }});
  // The second look begins when the first has ended.
  EXPECT_TRUE(testing::comes_true([&] { return looks >= 2; }));
  EXPECT_GE(condemned, 1);
}

}  // namespace
}  // namespace voxeld
