#include "server/jobs/workers/worker_files.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "server/base/disk/file.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

class WorkerFilesTest : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(files_.create()); }
  std::string write(const fs::path& path, const std::string& text) const {
    std::ofstream(path) << text;
    return path.string();
  }
  std::string output(const std::string& name) const {
    return write(fs::path(files_.folders().scratch_dir) / name, "output");
  }
  // The error of taking it.
  std::string refusal(const std::string& path) const {
    const auto taken = files_.take(path);
    return taken ? "taken" : taken.error().detail;
  }

  testing::TemporaryDir dir_;
  const WorkerFiles files_{dir_.path() / "w1"};
};

TEST_F(WorkerFilesTest, a_blob_is_handed_over_as_a_link_until_the_task_ends) {
  const std::string blob = write(dir_.path() / "sha256-ab", "mesh");
  const auto given = files_.hand_over(blob);
  ASSERT_TRUE(given) << given.error().message();
  EXPECT_EQ(*given, files_.folders().input_dir + "/sha256-ab");
  EXPECT_TRUE(fs::equivalent(*given, blob));
  EXPECT_EQ(files_.hand_over(blob).value(), *given);  // a sequence with two equal frames
  files_.clear();
  EXPECT_FALSE(fs::exists(*given));
  EXPECT_TRUE(fs::exists(blob));
}

TEST_F(WorkerFilesTest, a_missing_blob_is_an_error) {
  const auto given = files_.hand_over(dir_.path() / "sha256-ab");
  ASSERT_FALSE(given);
  EXPECT_EQ(given.error().message(), "the file sha256-ab is not stored");
}

// Without a second try, one in a hundred fails here.
TEST_F(WorkerFilesTest, a_blob_that_is_replaced_meanwhile_is_handed_over) {
  const fs::path blob = write(dir_.path() / "sha256-ab", "mesh");
  std::atomic<bool> is_over{false};
  std::thread store([&] {
    while (!is_over) fs::rename(write(dir_.path() / "new", "mesh"), blob);
  });
  int failures = 0;
  for (int i = 0; i < 5000; ++i) {
    if (!files_.hand_over(blob)) ++failures;
    files_.clear();
  }
  is_over = true;
  store.join();
  EXPECT_EQ(failures, 0);
}

TEST_F(WorkerFilesTest, an_output_is_taken_out_of_reach) {
  const std::string path = output("grid");
  const auto taken = files_.take(path);
  ASSERT_TRUE(taken) << taken.error().message();
  EXPECT_FALSE(fs::exists(path));
  EXPECT_TRUE(fs::exists(*taken));
  EXPECT_FALSE(taken->string().starts_with(files_.folders().scratch_dir));
}

TEST_F(WorkerFilesTest, only_plain_closed_files_of_the_folder_are_taken) {
  const std::string out = files_.folders().scratch_dir;
  const std::string blob = write(dir_.path() / "secret", "of another tenant");
  const std::string outside = "worker names an output outside its scratch directory";
  EXPECT_EQ(refusal(blob), outside);
  EXPECT_EQ(refusal(out + "/../../secret"), outside);
  EXPECT_EQ(refusal(out + "/.."), outside);
  fs::create_symlink(blob, out + "/link");
  EXPECT_NE(refusal(out + "/link"), "taken");
  fs::create_hard_link(blob, out + "/hard");
  EXPECT_EQ(refusal(out + "/hard"), "hard has other names");
  ASSERT_EQ(::mkfifo((out + "/fifo").c_str(), 0600), 0);
  EXPECT_EQ(refusal(out + "/fifo"), "fifo is not a regular file");
  fs::create_directory(out + "/folder");
  EXPECT_EQ(refusal(out + "/folder"), "folder is not a regular file");
  EXPECT_NE(refusal(out + "/nothing"), "taken");
}

// Else a worker could change what the store has hashed already.
TEST_F(WorkerFilesTest, a_file_that_is_open_for_writing_is_not_taken) {
  const std::string open = output("open"), mapped = output("mapped"), read = output("read");
  const UniqueFd writing(::open(open.c_str(), O_WRONLY));
  EXPECT_EQ(refusal(open), "worker has its output open still open for writing");
  UniqueFd mapping(::open(mapped.c_str(), O_RDWR));
  void* at = ::mmap(nullptr, 6, PROT_READ | PROT_WRITE, MAP_SHARED, mapping.get(), 0);
  mapping.reset();
  EXPECT_EQ(refusal(mapped), "worker has its output mapped still open for writing");
  ::munmap(at, 6);
  const UniqueFd reading(::open(read.c_str(), O_RDONLY));
  EXPECT_EQ(refusal(read), "taken");
}

TEST_F(WorkerFilesTest, the_end_of_a_task_leaves_nothing_and_the_end_of_a_worker_no_folder) {
  output("left");
  files_.clear();
  EXPECT_TRUE(fs::is_empty(files_.folders().scratch_dir));
  const fs::path root = fs::path(files_.folders().scratch_dir).parent_path();
  EXPECT_TRUE(fs::exists(root));
  files_.remove();
  EXPECT_FALSE(fs::exists(root));
}

}  // namespace
}  // namespace voxeld
