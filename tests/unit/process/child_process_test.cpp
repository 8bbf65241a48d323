#include "server/process/child_process.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "tests/unit/base/comes_true.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

TEST(ChildProcess, an_exit_status_is_reported_as_such) {
  ChildProcess child;
  ASSERT_TRUE(child.spawn("/bin/sh", {"-c", "exit 3"}));
  const ExitReason reason = child.wait();
  EXPECT_EQ(reason.status, 3);
  EXPECT_EQ(reason.signal, 0);
  EXPECT_EQ(reason.text(), "exit status 3");
  EXPECT_EQ(child.pid(), 0);
}

TEST(ChildProcess, a_signal_is_reported_by_number_and_name) {
  ChildProcess child;
  ASSERT_TRUE(child.spawn("/bin/sleep", {"100"}));
  EXPECT_TRUE(child.send_signal(SIGKILL));
  const ExitReason reason = child.wait();
  EXPECT_EQ(reason.signal, SIGKILL);
  EXPECT_EQ(reason.text(), "signal 9 (Killed)");
}

TEST(ChildProcess, a_program_that_is_not_there_exits_with_127) {
  ChildProcess child;
  ASSERT_TRUE(child.spawn("/no/such/program", {}));
  EXPECT_EQ(child.wait().text(), "exit status 127");
}

TEST(ChildProcess, no_signal_is_sent_once_the_child_was_reaped) {
  ChildProcess child;
  ASSERT_TRUE(child.spawn("/bin/true", {}));
  child.wait();
  EXPECT_FALSE(child.send_signal(SIGKILL));
}

TEST(ChildProcess, the_child_ends_with_the_thread_that_started_it) {
  testing::TemporaryDir dir;
  const std::string ready = (dir.path() / "ready").native();
  ChildProcess child;
  std::thread([&] {
    ASSERT_TRUE(child.spawn("/bin/sh", {"-c", "touch '" + ready + "'; exec sleep 100"}));
    EXPECT_TRUE(testing::comes_true([&] { return std::filesystem::exists(ready); }));
  }).join();
  EXPECT_EQ(child.wait().text(), "signal 9 (Killed)");
}

TEST(ChildProcess, the_child_has_no_signals_blocked_and_no_descriptors_but_the_standard_ones) {
  testing::TemporaryDir dir;
  const std::string out = (dir.path() / "out").native();
  std::ofstream leaked(dir.path() / "leaked");  // without O_CLOEXEC
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  ChildProcess child;
  const Status started = child.spawn(
      "/bin/sh", {"-c", "(grep SigBlk /proc/self/status; ls /proc/$$/fd | wc -w) > '" + out + "'"});
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  ASSERT_TRUE(started);
  EXPECT_EQ(child.wait().status, 0);
  std::ifstream file(out);
  std::string label, mask;
  int descriptors = 0;
  file >> label >> mask >> descriptors;
  EXPECT_EQ(mask, "0000000000000000");
  EXPECT_LE(descriptors, 4);  // 0, 1, 2 and perhaps the shell's copy of one of them
}

TEST(ChildProcess, the_memory_of_the_parent_is_not_copied) {
  constexpr size_t kBytes = size_t{32} << 20;
  const auto page = static_cast<size_t>(::sysconf(_SC_PAGESIZE));
  void* mapped =
      ::mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(mapped, MAP_FAILED);
  (void)::madvise(mapped, kBytes, MADV_NOHUGEPAGE);  // fails where there are none
  const auto write_all = [&] {
    for (size_t i = 0; i < kBytes; i += page) static_cast<volatile char*>(mapped)[i] = 1;
  };
  const auto faults = [] {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    return usage.ru_minflt;
  };
  write_all();
  ChildProcess child;
  ASSERT_TRUE(child.spawn("/bin/sleep", {"100"}));
  const auto before = faults();
  write_all();
  EXPECT_LT(faults() - before, static_cast<long>(kBytes / page / 2));
  child.send_signal(SIGKILL);
  child.wait();
  ::munmap(mapped, kBytes);
}

// Also if nobody has reaped it.
bool has_ended(pid_t pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("State:")) return line.find('Z') != std::string::npos;
  }
  return true;
}

TEST(RunChild, one_ends_with_the_process_that_waits_for_it) {
  testing::TemporaryDir dir;
  const std::string path = (dir.path() / "pid").native();
  const std::string writes = "echo $$ >'" + path + ".new'; mv '" + path + ".new' '" + path + "'";
  const pid_t parent = ::fork();
  if (parent == 0) {
    run_child({"/bin/sh", "-c", writes + "; exec sleep 600"}, std::chrono::minutes(10));
    ::_exit(0);
  }
  ASSERT_GT(parent, 0);
  EXPECT_TRUE(testing::comes_true([&] { return std::filesystem::exists(path); }));
  ::kill(parent, SIGKILL);
  ::waitpid(parent, nullptr, 0);
  pid_t child = 0;
  std::ifstream(path) >> child;
  ASSERT_GT(child, 0);
  EXPECT_TRUE(testing::comes_true([&] { return has_ended(child); }));
}

TEST(RunChild, a_program_that_is_not_there_is_named) {
  const ChildReply reply = run_child({"/no/such/program"}, std::chrono::minutes(10));
  EXPECT_EQ(reply.failure, "cannot run /no/such/program: No such file or directory");
}

TEST(RunChild, one_that_writes_without_end_is_ended) {
  const ChildReply reply =
      run_child({"/bin/sh", "-c", "while :; do echo driver; done"}, std::chrono::minutes(10));
  EXPECT_EQ(reply.failure, "the driver wrote more than 1048576 bytes");
}

TEST(RunChild, one_that_takes_too_long_is_ended) {
  const ChildReply reply = run_child({"/bin/sleep", "600"}, std::chrono::milliseconds(50));
  EXPECT_EQ(reply.failure, "the driver did not reply within 50 ms");
}

}  // namespace
}  // namespace voxeld
