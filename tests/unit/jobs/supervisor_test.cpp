#include "server/jobs/supervisor.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <thread>

#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

using std::chrono::milliseconds;

// Runs `script` with a shell instead of a worker; it sees the worker's arguments as $1 ….
SupervisorConfig shell(const testing::TemporaryDir& dir, const std::string& script) {
  const auto path = dir.path() / "worker.sh";
  std::ofstream(path) << "#!/bin/sh\n" << script << "\n";
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  SupervisorConfig config;
  config.executable = path.string();
  config.gateway = "unix:/none";
  config.devices = {"llvmpipe"};
  return config;
}

void wait_until(const std::function<bool()>& condition) {
  for (int i = 0; i < 1000 && !condition(); ++i) std::this_thread::sleep_for(milliseconds(10));
  EXPECT_TRUE(condition());
}

TEST(Supervisor, a_worker_that_ends_is_started_again_and_its_end_is_reported) {
  testing::TemporaryDir dir;
  SupervisorConfig config = shell(dir, "exit 7");
  std::atomic<int64_t> first_pid{0};
  std::atomic<int> exits{0};
  config.on_exit = [&](const std::string& device, const ExitReason& reason) {
    EXPECT_EQ(device, "llvmpipe");
    EXPECT_EQ(reason.text(), "exit status 7");
    if (exits++ == 0) first_pid = reason.pid;
  };
  Supervisor supervisor(config);
  wait_until([&] { return exits >= 3; });
  EXPECT_GE(supervisor.restarts("llvmpipe", 0), 3);
  EXPECT_EQ(supervisor.restarts("egl:0", 0), 0);
  const auto reason = supervisor.exit_reason(first_pid, milliseconds(0));
  ASSERT_TRUE(reason);
  EXPECT_EQ(reason->status, 7);
}

TEST(Supervisor, the_worker_gets_its_gateway_device_and_extra_arguments) {
  testing::TemporaryDir dir;
  const auto out = dir.path() / "arguments";
  SupervisorConfig config =
      shell(dir, "echo \"$@\" > " + out.string() + ".new; mv " + out.string() + ".new " +
                     out.string() + "; exec sleep 100");
  config.arguments = {"--shader-dir", "/shaders"};
  Supervisor supervisor(config);
  wait_until([&] { return std::filesystem::exists(out); });
  std::string line;
  std::getline(std::ifstream(out) >> std::ws, line);
  EXPECT_EQ(line, "worker --gateway unix:/none --device llvmpipe --shader-dir /shaders");
}

TEST(Supervisor, a_worker_that_ignores_sigterm_is_killed_after_the_grace) {
  testing::TemporaryDir dir;
  const auto ready = dir.path() / "ready";
  Supervisor supervisor(
      shell(dir, "trap '' TERM; touch " + ready.string() + "; while :; do sleep 0.05; done"));
  wait_until([&] { return std::filesystem::exists(ready); });
  const auto start = std::chrono::steady_clock::now();
  supervisor.stop(0.2);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
}

TEST(Supervisor, a_worker_is_killed_by_its_number_and_nothing_else_is) {
  testing::TemporaryDir dir;
  const auto file = dir.path() / "pid";
  SupervisorConfig config = shell(dir, "echo $$ > " + file.string() + ".new; mv " + file.string() +
                                           ".new " + file.string() + "; exec sleep 100");
  std::atomic<int> signal{0};
  config.on_exit = [&](const std::string&, const ExitReason& reason) { signal = reason.signal; };
  Supervisor supervisor(config);
  wait_until([&] { return std::filesystem::exists(file); });
  int64_t pid = 0;
  std::ifstream(file) >> pid;
  EXPECT_FALSE(supervisor.kill_worker(1));
  EXPECT_FALSE(supervisor.exit_reason(1, milliseconds(5000)));  // not ours: does not wait
  EXPECT_TRUE(supervisor.kill_worker(pid));
  EXPECT_EQ(supervisor.exit_reason(pid, milliseconds(5000))->text(), "signal 9 (Killed)");
  wait_until([&] { return signal == SIGKILL; });
}

}  // namespace
}  // namespace voxeld
