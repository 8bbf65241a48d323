// kill -9 of the process that owns the database, at any moment: what it acknowledged is there.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "server/jobs/service/job_service.h"
#include "server/process/child_process.h"
#include "tests/folders.h"
#include "tests/unit/base/comes_true.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

constexpr int kKills = 10;

class CrashTest : public ::testing::Test {
 protected:
  std::unique_ptr<JobService> open() {
    JobServiceConfig config;
    config.data_dir = dir_.path() / "data";
    config.start_workers = false;
    config.queued_jobs_max = 1'000'000;
    auto service = start_job_service(config, nullptr);
    EXPECT_TRUE(service) << service.error().message();
    return *std::move(service);
  }
  std::vector<std::string> acknowledged() {
    std::ifstream file(dir_.path() / "acknowledged");
    std::vector<std::string> ids;
    std::string line;
    while (std::getline(file, line) && !file.eof()) ids.push_back(line);  // the last may be torn
    return ids;
  }
  testing::TemporaryDir dir_;
};

TEST_F(CrashTest, no_acknowledged_job_is_lost) {
  std::string asset;
  {
    auto service = open();
    auto writer = service->begin_upload(100);
    ASSERT_TRUE(writer);
    const std::vector<uint8_t> bytes = {1, 2, 3};
    ASSERT_TRUE(writer->append(bytes));
    asset = service->put_asset(Caller::open(), writer->finish().value(), "a.ply", "").value().id;
  }
  const std::string command = "exec " + (test::program_dir() / "unit_jobs_helper").string() +
                              " submit " + (dir_.path() / "data").string() + " " + asset + " >> " +
                              (dir_.path() / "acknowledged").string();
  size_t before = 0;
  for (int i = 0; i < kKills; ++i) {
    ChildProcess child;
    ASSERT_TRUE(child.spawn("/bin/sh", {"-c", command}));
    // At least one new acknowledgement, then a moment more that differs from round to round.
    EXPECT_TRUE(testing::comes_true([&] { return acknowledged().size() > before; }));
    std::this_thread::sleep_for(std::chrono::milliseconds(7 * i));
    ASSERT_TRUE(child.send_signal(SIGKILL));
    EXPECT_EQ(child.wait().signal, SIGKILL);
    const auto ids = acknowledged();
    EXPECT_GT(ids.size(), before);
    before = ids.size();
    auto service = open();
    for (const std::string& id : ids) {
      const auto status = service->get(Caller::open(), id);
      ASSERT_TRUE(status) << "round " << i << ": lost " << id;
      EXPECT_EQ(status->state, JobState::kQueued);
    }
  }
  RecordProperty("acknowledged", static_cast<int>(before));
}

}  // namespace
}  // namespace voxeld
