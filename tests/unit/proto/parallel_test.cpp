#include "proto/parallel.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace voxeld {
namespace {

TEST(Parallel, every_index_is_worked_on_once) {
  for (const size_t count : {0u, 1u, 2u, 1000u}) {
    std::vector<std::atomic<int>> calls(count);
    for_each_parallel(count, [&](size_t i) { ++calls[i]; });
    for (const auto& call : calls) EXPECT_EQ(call, 1);
  }
}

TEST(Parallel, what_is_thrown_comes_out_after_all_threads_have_ended) {
  std::atomic<int> running = 0;
  EXPECT_THROW(for_each_parallel(100,
                                 [&](size_t i) {
                                   ++running;
                                   --running;
                                   if (i % 10 == 3) throw std::runtime_error("no");
                                 }),
               std::runtime_error);
  EXPECT_EQ(running, 0);
}

}  // namespace
}  // namespace voxeld
