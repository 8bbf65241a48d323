// Which thread unlinks files. A request that waits for that tells by its time whether others have
// the same bytes.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <chrono>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "server/base/sha256.h"
#include "tests/unit/jobs/service_fixture.h"

namespace {

std::mutex unlinked_mutex;
std::vector<std::pair<std::thread::id, std::string>> unlinked;

}  // namespace

// In the place of libc's for the whole test program.
extern "C" int unlink(const char* path) noexcept {
  {
    const std::lock_guard lock(unlinked_mutex);
    unlinked.emplace_back(std::this_thread::get_id(), path);
  }
  return static_cast<int>(::syscall(SYS_unlinkat, AT_FDCWD, path, 0));
}

namespace voxeld::testing {
namespace {

class RemovalTest : public ServiceTest {
 protected:
  // Files of the store that were unlinked: by this thread, and by others.
  static std::pair<int, int> unlinks() {
    std::pair<int, int> counts;
    const std::lock_guard lock(unlinked_mutex);
    for (const auto& [thread, path] : unlinked) {
      if (path.find("/blobs/") == path.npos && path.find("/trash/") == path.npos) continue;
      ++(thread == std::this_thread::get_id() ? counts.first : counts.second);
    }
    return counts;
  }
  static void forget() {
    const std::lock_guard lock(unlinked_mutex);
    unlinked.clear();
  }
  static void wait_for_unlinks(int number) {
    EXPECT_TRUE(comes_true([&] { return unlinks().second >= number; }));
  }
  std::string put(const Caller& caller, const std::string& text) {
    return service_->put_asset(caller, put_blob(text), "a.ply", "").value().id;
  }
  const Caller lab_ = Caller::tenant("lab", false), studio_ = Caller::tenant("studio", false);
};

TEST_F(RemovalTest, the_last_copy_is_unlinked_by_another_thread_than_the_one_that_deletes) {
  const std::string id = put(lab_, "mine alone");
  forget();
  ASSERT_TRUE(service_->delete_asset(lab_, id));
  EXPECT_EQ(unlinks().first, 0);
  wait_for_unlinks(1);
  EXPECT_FALSE(blobs().stat(id));
}

TEST_F(RemovalTest, a_copy_that_others_have_too_stays) {
  forget();
  const std::string id = put(lab_, "ours");
  put(studio_, "ours");
  wait_for_unlinks(1);  // of the file that the second upload replaced
  forget();
  ASSERT_TRUE(service_->delete_asset(lab_, id));
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));  // more than one look of the sweep
  EXPECT_EQ(unlinks(), (std::pair{0, 0}));
  EXPECT_TRUE(service_->get_asset(studio_, id));
}

TEST_F(RemovalTest, an_upload_of_bytes_that_are_there_unlinks_nothing_itself) {
  const std::string id = put(lab_, "ours");
  const int old = ::open(blobs().path_of(id).c_str(), O_RDONLY | O_CLOEXEC);
  ASSERT_GE(old, 0);
  forget();
  put(studio_, "ours");
  EXPECT_EQ(unlinks().first, 0);
  wait_for_unlinks(1);
  ::close(old);
}

}  // namespace
}  // namespace voxeld::testing
