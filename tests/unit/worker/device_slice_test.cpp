#include "server/worker/gateway/device_slice.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "server/base/parallel.h"
#include "tests/unit/worker/fake_gateway.h"

namespace voxeld {
namespace {

using testing::FakeGateway;

// A gateway that grants `grants` time slices and then refuses, and a task that asks it.
class DeviceSliceTest : public ::testing::Test {
 protected:
  explicit DeviceSliceTest(int grants = 1'000'000) : left_(grants) {}

  std::string reply(const nlohmann::json& request) {
    asked_.push_back(request.at("type").get<std::string>());
    SliceReply reply;
    reply.granted = left_-- > 0;
    return to_json_message(reply).dump();
  }
  // Works through cancellation points until so many time slices have begun.
  void work_until_begun(int64_t slices) {
    while (begun_ < slices) {
      slice_.tick();
      cancel_point();
    }
  }

  std::atomic<int> left_;
  std::vector<std::string> asked_;
  std::atomic<int64_t> begun_{0};
  FakeGateway gateway_{[this](const nlohmann::json& request) {
    ++begun_;
    return reply(request);
  }};
  std::unique_ptr<SliceClient> client_ = SliceClient::connect(gateway_.address()).value();
  DeviceSlice slice_{client_.get(), Task{}};
  const std::atomic<bool> flag_{false};
};

TEST_F(DeviceSliceTest, is_renewed_at_cancellation_points) {
  const CancelScope scope(flag_, &slice_.pause());
  ASSERT_TRUE(slice_.begin().ok());
  work_until_begun(4);
  EXPECT_EQ(asked_,
            (std::vector<std::string>{"slice_take", "slice_renew", "slice_renew", "slice_renew"}));
}

TEST_F(DeviceSliceTest, is_renewed_by_any_thread_of_a_loop) {
  const CancelScope scope(flag_, &slice_.pause());
  ASSERT_TRUE(slice_.begin().ok());
  ThreadTeam(4).run(4, [&](int part) { work_until_begun(3 + part); });
  EXPECT_GE(begun_, 6);
}

TEST_F(DeviceSliceTest, is_not_renewed_before_it_is_old_nor_when_it_is_not_held) {
  const CancelScope scope(flag_, &slice_.pause());
  slice_.tick();
  EXPECT_FALSE(slice_.pause().is_due);
  ASSERT_TRUE(slice_.begin().ok());
  while (!slice_.pause().is_due) slice_.tick();
  slice_.end();
  EXPECT_NO_THROW(cancel_point());
  EXPECT_FALSE(slice_.pause().is_due);
  EXPECT_EQ(asked_.front(), "slice_take");
}

class RefusedSliceTest : public DeviceSliceTest {
 protected:
  RefusedSliceTest() : DeviceSliceTest(1) {}
};

TEST_F(RefusedSliceTest, ends_the_task_at_every_later_point) {
  const CancelScope scope(flag_, &slice_.pause());
  ASSERT_TRUE(slice_.begin().ok());
  EXPECT_THROW(work_until_begun(1000), Cancelled);
  EXPECT_THROW(cancel_point(), Cancelled);
}

TEST_F(DeviceSliceTest, without_a_gateway_there_is_no_pause) {
  DeviceSlice alone(nullptr, Task{});
  ASSERT_TRUE(alone.begin().ok());
  const auto end = std::chrono::steady_clock::now() + 2 * DeviceSlice::kQuantum;
  while (std::chrono::steady_clock::now() < end) alone.tick();
  EXPECT_FALSE(alone.pause().is_due);
}

}  // namespace
}  // namespace voxeld
