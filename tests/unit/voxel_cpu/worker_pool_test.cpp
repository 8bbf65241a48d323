#include "server/voxel/cpu/worker_pool.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>

namespace voxeld {
namespace {

TEST(WorkerPool, runs_each_part_once_and_waits_for_all) {
  WorkerPool pool(4);
  EXPECT_EQ(pool.threads(), 4);
  for (int job = 0; job < 2000; ++job) {
    const int count = job % 5;
    std::array<std::atomic<int>, 4> runs{};
    pool.run(count, [&](int worker) { ++runs[static_cast<size_t>(worker)]; });
    for (int worker = 0; worker < 4; ++worker) {
      ASSERT_EQ(runs[static_cast<size_t>(worker)], worker < count ? 1 : 0) << "job " << job;
    }
  }
}

TEST(WorkerPool, of_one_thread_runs_on_the_callers) {
  WorkerPool pool(1);
  std::thread::id id;
  pool.run(1, [&](int) { id = std::this_thread::get_id(); });
  EXPECT_EQ(id, std::this_thread::get_id());
}

}  // namespace
}  // namespace voxeld
