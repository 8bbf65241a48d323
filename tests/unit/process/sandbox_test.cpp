// Each test plays a process that a hostile file has taken over: a child that has given up what a
// worker gives up tries something and tells what came of it.
#include "server/process/sandbox.h"

#include <asm/sockios.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/keyctl.h>
#include <sched.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <sys/xattr.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "server/base/disk/file.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

// Sanitizers need what restrict_calls() else takes, for the check of leaks at the end.
#ifdef VOXELD_SANITIZED
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

constexpr int kDone = 0, kDenied = 1, kNoSandbox = 2, kOther = 3;

// The outcome of a system call: done, or denied in one of the ways a sandbox denies.
int outcome(long result) {
  if (result >= 0) return kDone;
  return errno == EPERM || errno == EACCES || errno == ENOSYS || errno == EXDEV ? kDenied : kOther;
}

class SandboxTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (landlock_abi() == 0 || !seccomp_available()) GTEST_SKIP() << "no Landlock or no seccomp";
    for (const char* name : {"in", "out", "shared", "blobs"}) fs::create_directory(path(name));
    write("in/mine", "input of this task");
    write("blobs/theirs", "input of another tenant");
    fs::create_directory_symlink(path("blobs"), path("out/escape"));
  }

  std::string path(const std::string& name) const { return (dir_.path() / name).string(); }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name)) << text;
  }
  std::string read(const std::string& name) const {
    std::ifstream file(path(name));
    return {std::istreambuf_iterator<char>(file), {}};
  }

  // The outcome of `act` in a child that has entered the sandbox; kDenied if it was killed for it.
  int tried(const std::function<int()>& attempt) const {
    const pid_t child = ::fork();
    if (child == 0) {
      const bool entered = restrict_files({{path("in"), FileRule::Access::kRead},
                                           {path("out"), FileRule::Access::kOutput},
                                           {path("shared"), FileRule::Access::kSharedMemory},
                                           {"/proc/self", FileRule::Access::kRead}}) &&
                           restrict_resources() && restrict_calls();
      ::_exit(entered ? attempt() : kNoSandbox);
    }
    int status = 0;
    EXPECT_EQ(::waitpid(child, &status, 0), child);
    if (WIFSIGNALED(status)) return WTERMSIG(status) == SIGSYS ? kDenied : kOther;
    return WEXITSTATUS(status);
  }

  testing::TemporaryDir dir_;
};

int open_close(const std::string& path, int flags) {
  const int fd = ::open(path.c_str(), flags, 0600);
  if (fd >= 0) ::close(fd);
  return outcome(fd);
}

TEST_F(SandboxTest, its_own_files_can_be_read_written_renamed_and_removed) {
  EXPECT_EQ(tried([&] { return open_close(path("in/mine"), O_RDONLY); }), kDone);
  EXPECT_EQ(tried([&] { return open_close(path("out/new"), O_RDWR | O_CREAT | O_TRUNC); }), kDone);
  EXPECT_EQ(
      tried([&] { return outcome(::rename(path("out/new").c_str(), path("out/newer").c_str())); }),
      kDone);
  EXPECT_EQ(tried([&] { return outcome(::unlink(path("out/newer").c_str())); }), kDone);
}

TEST_F(SandboxTest, threads_and_memory_can_be_had) {
  EXPECT_EQ(tried([] {
              std::atomic<int> ran = 0;
              std::thread([&] { ran = 1; }).join();
              void* code =
                  ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
              const bool jit = ::mprotect(code, 4096, PROT_READ | PROT_EXEC) == 0;
              return ran == 1 && jit ? kDone : kOther;
            }),
            kDone);
}

TEST_F(SandboxTest, shared_memory_can_be_made_and_removed_but_not_listed) {
  EXPECT_EQ(tried([&] {
              const std::string segment = path("shared/segment");
              const int fd = ::open(segment.c_str(), O_RDWR | O_CREAT | O_EXCL, 0600);
              if (fd < 0 || ::ftruncate(fd, 4096) != 0) return kOther;
              void* at = ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
              return at == MAP_FAILED ? kOther : outcome(::unlink(segment.c_str()));
            }),
            kDone);
  EXPECT_EQ(tried([&] { return open_close(path("shared"), O_RDONLY | O_DIRECTORY); }), kDenied);
  EXPECT_EQ(tried([&] { return outcome(::mkdir(path("shared/folder").c_str(), 0700)); }), kDenied);
}

TEST_F(SandboxTest, folders_can_be_listed_by_the_old_call_too) {
#ifdef SYS_getdents
  EXPECT_EQ(tried([&] {
              const int fd = ::open(path("in").c_str(), O_RDONLY | O_DIRECTORY);
              char entries[4096];
              return ::syscall(SYS_getdents, fd, entries, sizeof entries) > 0 ? kDone : kOther;
            }),
            kDone);
#endif
}

TEST_F(SandboxTest, options_of_prctl_that_read_are_allowed) {
  for (const int option : {PR_GET_KEEPCAPS, PR_GET_SECUREBITS, PR_GET_TIMING, PR_GET_THP_DISABLE}) {
    EXPECT_EQ(tried([&] { return outcome(::prctl(option, 0, 0, 0, 0)); }), kDone) << option;
  }
  if (kSanitized) return;
  EXPECT_EQ(tried([] { return outcome(::prctl(PR_SET_PDEATHSIG, 0, 0, 0, 0)); }), kDenied);
  EXPECT_EQ(tried([] { return outcome(::prctl(PR_SET_KEEPCAPS, 1, 0, 0, 0)); }), kDenied);
}

TEST_F(SandboxTest, other_files_cannot_be_opened_by_any_path) {
  const std::string gateway = "/proc/" + std::to_string(::getpid());
  for (const std::string& other :
       {path("blobs/theirs"), path("in/../blobs/theirs"), path("out/escape/theirs"),
        "/proc/self/root" + path("blobs/theirs"), std::string("/etc/passwd"),
        std::string("/proc/1/cmdline"), gateway + "/mem", gateway + "/environ", gateway + "/maps",
        gateway + "/root" + path("blobs/theirs")}) {
    EXPECT_EQ(open_close(other, O_RDONLY), kDone) << other << " without a sandbox";
    EXPECT_EQ(tried([&] { return open_close(other, O_RDONLY); }), kDenied) << other;
  }
  EXPECT_EQ(tried([&] { return open_close(path("blobs"), O_RDONLY | O_DIRECTORY); }), kDenied);
  EXPECT_EQ(tried([&] { return open_close(gateway + "/mem", O_RDWR); }), kDenied);
  EXPECT_EQ(tried([&] {
              const int root = ::open(path("out").c_str(), O_PATH | O_DIRECTORY);
              return outcome(::openat(root, "../blobs/theirs", O_RDONLY));
            }),
            kDenied);
}

TEST_F(SandboxTest, inputs_cannot_be_changed) {
  const std::string mine = path("in/mine");
  const std::vector<std::pair<const char*, std::function<long()>>> attempts = {
      {"write", [&] { return ::open(mine.c_str(), O_WRONLY); }},
      {"read and write", [&] { return ::open(mine.c_str(), O_RDWR); }},
      {"cut on reading", [&] { return ::open(mine.c_str(), O_RDONLY | O_TRUNC); }},
      {"truncate", [&] { return ::truncate(mine.c_str(), 0); }},
      {"create", [&] { return ::open(path("in/new").c_str(), O_WRONLY | O_CREAT, 0600); }},
      {"unlink", [&] { return ::unlink(mine.c_str()); }},
      {"rename", [&] { return ::rename(mine.c_str(), path("in/yours").c_str()); }},
      {"rename out", [&] { return ::rename(mine.c_str(), path("out/mine").c_str()); }},
      {"link", [&] { return ::link(mine.c_str(), path("out/mine").c_str()); }},
      {"chmod", [&] { return ::chmod(mine.c_str(), 0777); }},
      {"chown", [&] { return ::chown(mine.c_str(), 1, 1); }},
      {"utimes", [&] { return ::utimes(mine.c_str(), nullptr); }},
      {"setxattr", [&] { return ::setxattr(mine.c_str(), "user.a", "b", 1, 0); }},
      {"map for writing",
       [&]() -> long {
         const int fd = ::open(mine.c_str(), O_RDONLY);
         void* at = ::mmap(nullptr, 1, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
         return at == MAP_FAILED ? -1 : 0;
       }},
      {"write by /proc", [&]() -> long {
         const int fd = ::open(mine.c_str(), O_RDONLY);
         return ::open(("/proc/self/fd/" + std::to_string(fd)).c_str(), O_RDWR);
       }}};
  for (const auto& one : attempts) {
    EXPECT_EQ(tried([&] { return outcome(one.second()); }), kDenied) << one.first;
  }
  EXPECT_EQ(read("in/mine"), "input of this task");
}

TEST_F(SandboxTest, nothing_gets_out_of_the_folder_of_outputs) {
  write("out/file", "output");
  const std::string file = path("out/file");
  const std::vector<std::pair<const char*, std::function<long()>>> attempts = {
      {"rename out", [&] { return ::rename(file.c_str(), path("blobs/theirs").c_str()); }},
      {"rename over an input", [&] { return ::rename(file.c_str(), path("in/mine").c_str()); }},
      {"rename in", [&] { return ::rename(path("blobs/theirs").c_str(), file.c_str()); }},
      {"through a link",
       [&] { return ::open(path("out/escape/x").c_str(), O_CREAT | O_RDWR, 0600); }},
      {"symlink", [&] { return ::symlink("/etc/passwd", path("out/link").c_str()); }},
      {"hard link", [&] { return ::link(path("blobs/theirs").c_str(), path("out/link").c_str()); }},
      {"fifo", [&] { return ::mkfifo(path("out/fifo").c_str(), 0600); }},
      {"device", [&] { return ::mknod(path("out/dev").c_str(), S_IFCHR | 0600, 0x101); }},
      {"set user id", [&] { return ::chmod(file.c_str(), 04755); }}};
  for (const auto& one : attempts) {
    EXPECT_EQ(tried([&] { return outcome(one.second()); }), kDenied) << one.first;
  }
  EXPECT_EQ(read("blobs/theirs"), "input of another tenant");
  EXPECT_EQ(read("in/mine"), "input of this task");
}

TEST_F(SandboxTest, there_is_no_network) {
  for (const int family : {AF_INET, AF_INET6, AF_UNIX, AF_NETLINK}) {
    EXPECT_EQ(tried([&] { return outcome(::socket(family, SOCK_STREAM, 0)); }), kDenied) << family;
  }
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path("sock").copy(address.sun_path, sizeof address.sun_path - 1);
  const auto* generic = reinterpret_cast<const sockaddr*>(&address);
  const UniqueFd listener(::socket(AF_UNIX, SOCK_STREAM, 0));
  ASSERT_EQ(::bind(listener.get(), generic, sizeof address), 0);
  ASSERT_EQ(::listen(listener.get(), 1), 0);
  // Made before: what a worker has of its own.
  const UniqueFd before(::socket(AF_UNIX, SOCK_STREAM, 0));
  EXPECT_EQ(tried([&] { return outcome(::connect(before.get(), generic, sizeof address)); }),
            kDenied);
  EXPECT_EQ(tried([&] { return outcome(::accept(listener.get(), nullptr, nullptr)); }), kDenied);
  int ends[2];
  EXPECT_EQ(tried([&] { return outcome(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends)); }), kDenied);
}

TEST_F(SandboxTest, there_are_no_new_processes) {
  EXPECT_EQ(tried([] { return outcome(::execl("/bin/true", "true", nullptr)); }), kDenied);
  EXPECT_EQ(tried([] { return outcome(::syscall(SYS_fork)); }), kDenied);
  if (!kSanitized) {
    EXPECT_EQ(tried([] { return outcome(::syscall(SYS_clone, SIGCHLD, 0, 0, 0, 0)); }), kDenied);
  }
  EXPECT_EQ(tried([] { return outcome(::syscall(SYS_clone3, nullptr, 0)); }), kDenied);
  EXPECT_EQ(tried([] { return outcome(::unshare(CLONE_NEWUSER)); }), kDenied);
}

TEST_F(SandboxTest, other_processes_are_out_of_reach) {
  const pid_t gateway = ::getpid();
  if (!kSanitized) {
    EXPECT_EQ(tried([&] { return outcome(::kill(gateway, SIGKILL)); }), kDenied);
    EXPECT_EQ(tried([&] { return outcome(::kill(gateway, 0)); }), kDenied);
    EXPECT_EQ(tried([&] { return outcome(::kill(-1, SIGTERM)); }), kDenied);
    EXPECT_EQ(tried([&] { return outcome(::syscall(SYS_tgkill, gateway, gateway, SIGTERM)); }),
              kDenied);
  }
  EXPECT_EQ(tried([&] { return outcome(::syscall(SYS_tkill, gateway, SIGTERM)); }), kDenied);
  EXPECT_EQ(tried([&] { return outcome(::syscall(SYS_pidfd_open, gateway, 0)); }), kDenied);
  EXPECT_EQ(tried([&] { return outcome(::ptrace(PTRACE_ATTACH, gateway, nullptr, nullptr)); }),
            kDenied);
  EXPECT_EQ(tried([&] { return outcome(::syscall(SYS_process_vm_readv, gateway, 0, 0, 0, 0, 0)); }),
            kDenied);
  // A descriptor that signals its owner when it gets ready.
  int pipe[2];
  ASSERT_EQ(::pipe(pipe), 0);
  EXPECT_EQ(tried([&] { return outcome(::fcntl(pipe[0], F_SETOWN, gateway)); }), kDenied);
  EXPECT_EQ(tried([&] { return outcome(::fcntl(pipe[0], F_SETSIG, SIGKILL)); }), kDenied);
  EXPECT_EQ(tried([&] { return outcome(::ioctl(pipe[0], FIOSETOWN, &gateway)); }), kDenied);
  ::close(pipe[0]);
  ::close(pipe[1]);
  const rlimit limit{1, 1};
  EXPECT_EQ(tried([&] {
              return outcome(::syscall(SYS_prlimit64, gateway, RLIMIT_NOFILE, &limit, nullptr));
            }),
            kDenied);
}

TEST_F(SandboxTest, the_kernel_refuses_forbidden_calls) {
  const std::vector<std::pair<const char*, std::function<long()>>> attempts = {
      {"mount", [] { return ::mount("none", "/mnt", "tmpfs", 0, nullptr); }},
      {"chroot", [] { return ::chroot("/"); }},
      {"setuid", [] { return ::setuid(0); }},
      {"bpf", [] { return ::syscall(SYS_bpf, 0, nullptr, 0); }},
      {"perf", [] { return ::syscall(SYS_perf_event_open, nullptr, 0, -1, -1, 0); }},
      {"keyctl", [] { return ::syscall(SYS_keyctl, KEYCTL_GET_KEYRING_ID, -1, 0, 0, 0); }},
      {"io_uring", [] { return ::syscall(SYS_io_uring_setup, 1, nullptr); }},
      {"userfaultfd", [] { return ::syscall(SYS_userfaultfd, 0); }},
      {"by handle", [] { return ::syscall(SYS_open_by_handle_at, -1, nullptr, 0); }},
      {"terminal input", [] { return ::ioctl(0, TIOCSTI, "x"); }},
      {"dumpable",
       [] { return kSanitized ? ::chroot("/") : ::prctl(PR_SET_DUMPABLE, 1, 0, 0, 0); }},
      {"seccomp", [] { return ::syscall(SYS_seccomp, 0, 0, nullptr); }},
      {"a number that no kernel has", [] { return ::syscall(100'000); }}};
  for (const auto& one : attempts) {
    EXPECT_EQ(tried([&] { return outcome(one.second()); }), kDenied) << one.first;
  }
}

TEST_F(SandboxTest, limits_cannot_be_raised_again) {
  EXPECT_EQ(tried([] {
              rlimit core{}, files{};
              ::getrlimit(RLIMIT_CORE, &core);
              ::getrlimit(RLIMIT_NOFILE, &files);
              return core.rlim_max == 0 && files.rlim_max <= 1024 ? kDone : kOther;
            }),
            kDone);
  const rlimit many{4096, 4096};
  EXPECT_EQ(tried([&] { return outcome(::setrlimit(RLIMIT_NOFILE, &many)); }), kDenied);
}

// Drivers have threads by then.
TEST_F(SandboxTest, threads_that_run_already_lose_their_system_calls_too) {
  const pid_t child = ::fork();
  if (child == 0) {
    std::atomic<bool> entered = false;
    int result = kOther;
    std::thread early([&] {
      while (!entered) std::this_thread::yield();
      result = outcome(::socket(AF_INET, SOCK_STREAM, 0));
    });
    const bool is_in = restrict_calls().ok();
    entered = true;
    early.join();
    ::_exit(is_in ? result : kNoSandbox);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), kDenied);
}

TEST_F(SandboxTest, threads_that_start_later_reach_no_other_files_either) {
  EXPECT_EQ(tried([&] {
              int result = kOther;
              std::thread([&] { result = open_close(path("blobs/theirs"), O_RDONLY); }).join();
              return result;
            }),
            kDenied);
}

}  // namespace
}  // namespace voxeld
