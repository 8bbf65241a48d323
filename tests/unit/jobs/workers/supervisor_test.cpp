#include "server/jobs/workers/supervisor.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <thread>
#include <vector>

#include "tests/unit/base/comes_true.h"
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
  EXPECT_TRUE(testing::comes_true([&] { return exits >= 3; }));
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
  EXPECT_TRUE(testing::comes_true([&] { return std::filesystem::exists(out); }));
  std::string line;
  std::getline(std::ifstream(out) >> std::ws, line);
  EXPECT_EQ(line, "worker --gateway unix:/none --device llvmpipe --shader-dir /shaders");
}

TEST(Supervisor, a_worker_that_ignores_sigterm_is_killed_after_the_grace) {
  testing::TemporaryDir dir;
  const auto ready = dir.path() / "ready";
  Supervisor supervisor(shell(dir, "trap '' TERM; echo $$ > " + ready.string() + ".new; mv " +
                                       ready.string() + ".new " + ready.string() +
                                       "; while :; do sleep 0.05; done"));
  EXPECT_TRUE(testing::comes_true([&] { return std::filesystem::exists(ready); }));
  int64_t pid = 0;
  std::ifstream(ready) >> pid;
  supervisor.stop(0.2);
  const auto reason = supervisor.exit_reason(pid, milliseconds(0));
  ASSERT_TRUE(reason);
  EXPECT_EQ(reason->text(), "signal 9 (Killed)");
}

TEST(Supervisor, a_worker_is_killed_by_its_number_and_nothing_else_is) {
  testing::TemporaryDir dir;
  const auto file = dir.path() / "pid";
  SupervisorConfig config = shell(dir, "echo $$ > " + file.string() + ".new; mv " + file.string() +
                                           ".new " + file.string() + "; exec sleep 100");
  std::atomic<int> signal{0};
  config.on_exit = [&](const std::string&, const ExitReason& reason) { signal = reason.signal; };
  Supervisor supervisor(config);
  EXPECT_TRUE(testing::comes_true([&] { return std::filesystem::exists(file); }));
  int64_t pid = 0;
  std::ifstream(file) >> pid;
  EXPECT_FALSE(supervisor.kill_worker(1));
  EXPECT_FALSE(supervisor.exit_reason(1, testing::kPatience));  // not ours: does not wait
  EXPECT_TRUE(supervisor.kill_worker(pid));
  const auto reason = supervisor.exit_reason(pid, testing::kPatience);
  ASSERT_TRUE(reason);
  EXPECT_EQ(reason->text(), "signal 9 (Killed)");
  EXPECT_TRUE(testing::comes_true([&] { return signal == SIGKILL; }));
}

TEST(Supervisor, a_replaced_worker_is_no_restart_and_the_next_one_starts_at_once) {
  testing::TemporaryDir dir;
  const auto file = dir.path() / "pids";
  SupervisorConfig config = shell(dir, "echo $$ >> " + file.string() + "; exec sleep 100");
  std::atomic<int> exits{0};
  config.on_exit = [&](const std::string&, const ExitReason&) { ++exits; };
  Supervisor supervisor(config);
  const auto pids = [&] {
    std::vector<int64_t> all;
    std::ifstream in(file);
    for (int64_t pid = 0; in >> pid;) all.push_back(pid);
    return all;
  };
  // All within one deadline: with the pause after an exit that doubles, they would take minutes.
  constexpr size_t kTimes = 20;
  size_t replaced = 0;
  ASSERT_TRUE(testing::comes_true([&] {
    const std::vector<int64_t> started = pids();
    if (started.size() > kTimes) return true;
    if (started.size() > replaced) {
      supervisor.replace(started.back());
      ++replaced;
    }
    return false;
  }));
  EXPECT_EQ(pids().size(), kTimes + 1);
  EXPECT_EQ(exits, 0);
  EXPECT_EQ(supervisor.restarts("llvmpipe", 0), 0);
  EXPECT_EQ(supervisor.exit_reason(pids()[0], milliseconds(0))->text(), "signal 9 (Killed)");
  // A crash after it counts.
  EXPECT_TRUE(supervisor.kill_worker(pids().back()));
  EXPECT_TRUE(testing::comes_true([&] { return exits == 1; }));
  EXPECT_EQ(supervisor.restarts("llvmpipe", 0), 1);
}

TEST(Supervisor, workers_that_end_with_a_task_are_followed_without_a_long_pause) {
  testing::TemporaryDir dir;
  const auto file = dir.path() / "pids";
  Supervisor supervisor(shell(dir, "echo $$ >> " + file.string() + "; exec sleep 100"));
  // All within one deadline: with the pause after an exit that doubles, they would take minutes.
  constexpr int64_t kTimes = 20;
  int64_t killed = 0;
  ASSERT_TRUE(testing::comes_true([&] {
    if (killed == kTimes) return true;
    int64_t started = 0, last = 0;
    std::ifstream in(file);
    for (int64_t pid = 0; in >> pid;) last = pid, ++started;
    if (started == killed) return false;
    supervisor.has_task(last);
    if (supervisor.kill_worker(last)) ++killed;
    return false;
  }));
  EXPECT_TRUE(testing::comes_true([&] { return supervisor.restarts("llvmpipe", 0) == kTimes; }));
}

TEST(Supervisor, the_reserve_starts_with_the_first_worker_and_grows_only) {
  testing::TemporaryDir dir;
  const auto file = dir.path() / "starts";
  SupervisorConfig config = shell(dir, "echo x >> " + file.string() + "; exec sleep 100");
  config.workers_per_device = 2;
  config.reserve_max = 3;
  Supervisor supervisor(config);
  const auto starts = [&] {
    std::ifstream in(file);
    std::string line;
    size_t count = 0;
    while (std::getline(in, line)) ++count;
    return count;
  };
  supervisor.keep_reserve(1);
  EXPECT_TRUE(testing::comes_true([&] { return starts() == 1; }));
  std::this_thread::sleep_for(milliseconds(100));
  EXPECT_EQ(starts(), 1u);
  supervisor.start_others("llvmpipe");
  EXPECT_TRUE(testing::comes_true([&] { return starts() == 3; }));
  supervisor.keep_reserve(0);
  EXPECT_EQ(supervisor.reserve(), 1);
  supervisor.keep_reserve(9);
  EXPECT_EQ(supervisor.reserve(), 3);
  EXPECT_TRUE(testing::comes_true([&] { return starts() == 5; }));
}

TEST(Supervisor, an_extra_worker_goes_and_does_not_come_back) {
  testing::TemporaryDir dir;
  const auto file = dir.path() / "pids";
  SupervisorConfig config = shell(dir, "echo $$ >> " + file.string() + "; exec sleep 100");
  config.extra_max = 2;
  Supervisor supervisor(config);
  const auto pids = [&] {
    std::vector<int64_t> all;
    std::ifstream in(file);
    for (int64_t pid = 0; in >> pid;) all.push_back(pid);
    return all;
  };
  supervisor.start_others("llvmpipe");
  EXPECT_TRUE(testing::comes_true([&] { return pids().size() == 1; }));
  supervisor.set_extra("llvmpipe", 1);
  EXPECT_TRUE(testing::comes_true([&] { return pids().size() == 2; }));
  const int64_t extra = pids()[1];
  EXPECT_EQ(supervisor.slot_of(extra), 1);
  supervisor.set_extra("llvmpipe", 0);
  EXPECT_EQ(supervisor.slot_of(extra), 1);  // it works on
  supervisor.replace(extra);
  EXPECT_TRUE(testing::comes_true([&] { return !supervisor.slot_of(extra); }));
  // The other one is replaced meanwhile, so its thread has had the time to start one.
  supervisor.replace(pids()[0]);
  EXPECT_TRUE(testing::comes_true([&] { return pids().size() == 3; }));
  EXPECT_EQ(supervisor.slot_of(pids()[2]), 0);
  supervisor.set_extra("llvmpipe", 9);
  EXPECT_TRUE(testing::comes_true([&] { return pids().size() == 5; }));
}

}  // namespace
}  // namespace voxeld
