// The worker's half of the task API against a gateway that the test plays.
#include "server/worker/gateway/task_monitor.h"

#include <gtest/gtest.h>

#include <atomic>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "tests/unit/base/comes_true.h"
#include "tests/unit/worker/fake_gateway.h"

namespace voxeld {
namespace {

using nlohmann::json;
using Gateway = testing::FakeGateway;

Task a_task() {
  Task task;
  task.id = "j-1";
  task.fence = 3;
  return task;
}

TEST(TaskMonitor, reports_go_out_while_the_task_is_busy_and_a_cancel_stops_it) {
  std::atomic<int> reports{0};  // of stage voxelize
  std::atomic<bool> cancels{false};
  Gateway gateway([&](const json& message) {
    EXPECT_EQ(message["type"], "progress");
    EXPECT_EQ(message["fence"], 3);
    if (message["stage"] == "voxelize") ++reports;
    return cancels ? R"({"cancel":true,"fenced":false})" : R"({"cancel":false,"fenced":false})";
  });
  auto client = TaskClient::connect(gateway.address());
  ASSERT_TRUE(client);
  TaskMonitor monitor(**client, a_task());
  monitor.set_stage("voxelize");
  EXPECT_TRUE(monitor.set_progress(1, 8));
  EXPECT_TRUE(testing::comes_true([&] { return reports >= 2; }));
  EXPECT_TRUE(monitor.check());
  cancels = true;
  EXPECT_TRUE(testing::comes_true([&] { return !monitor.check(); }));
  EXPECT_FALSE(monitor.set_progress(2, 8));
  EXPECT_EQ(monitor.check().error().code, ErrorCode::kCancelled);
  EXPECT_FALSE(monitor.dropped());
}

TEST(TaskMonitor, a_fenced_task_is_dropped) {
  Gateway gateway([](const json&) { return R"({"cancel":false,"fenced":true})"; });
  auto client = TaskClient::connect(gateway.address());
  TaskMonitor monitor(**client, a_task());
  EXPECT_TRUE(testing::comes_true([&] { return monitor.dropped(); }));
  EXPECT_TRUE(testing::comes_true([&] { return !monitor.check(); }));
}

TEST(TaskMonitor, a_gateway_that_goes_away_drops_the_task) {
  Gateway gateway([](const json&) { return ""; });
  auto client = TaskClient::connect(gateway.address());
  TaskMonitor monitor(**client, a_task());
  EXPECT_TRUE(testing::comes_true([&] { return monitor.dropped(); }));
}

TEST(TaskClient, other_gateways_than_a_unix_socket_are_refused_by_name) {
  const auto client = TaskClient::connect("http://example.org");
  ASSERT_FALSE(client);
  EXPECT_EQ(client.error().message(),
            "cannot reach this gateway: expected unix:/path/to/tasks.sock, got http://example.org");
}

TEST(TaskClient, a_reply_without_a_task_is_an_error_and_not_a_task) {
  Gateway gateway([](const json&) { return R"({"ok":true})"; });
  auto client = TaskClient::connect(gateway.address());
  EXPECT_FALSE((*client)->claim());
}

}  // namespace
}  // namespace voxeld
