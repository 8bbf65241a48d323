#include <asm/sockios.h>
#include <fcntl.h>
#include <linux/sched.h>
#include <seccomp.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "server/base/disk/file.h"
#include "server/process/sandbox.h"

namespace voxeld {
namespace {

constexpr rlim_t kDescriptorsMax = 1024;
// Bytes of one file. A longer one fails with EFBIG, so a faulty worker does not fill the disk.
constexpr rlim_t kFileBytesMax = rlim_t{64} << 30;
constexpr uint64_t kLow32Bits = 0xffffffff;  // the bits of an int that the kernel reads

// Allowed system calls. Names that an architecture lacks are ignored.
constexpr const char* kAllowed[] = {
    // memory
    "brk", "get_mempolicy", "madvise", "mbind", "membarrier", "memfd_create", "mincore", "mlock",
    "mlock2", "mmap", "mprotect", "mremap", "msync", "munlock", "munmap", "set_mempolicy",
    // open files, and those that restrict_files() leaves
    "access", "close", "close_range", "copy_file_range", "creat", "dup", "dup2", "dup3",
    "faccessat", "faccessat2", "fadvise64", "fallocate", "fcntl", "fdatasync", "flock", "fstat",
    "fstatfs", "fsync", "ftruncate", "getcwd", "getdents", "getdents64", "ioctl", "lseek", "lstat",
    "mkdir", "mkdirat", "newfstatat", "open", "openat", "pread64", "preadv", "pwrite64", "pwritev",
    "read", "readahead", "readlink", "readlinkat", "readv", "rename", "renameat", "renameat2",
    "rmdir", "sendfile", "stat", "statfs", "statx", "unlink", "unlinkat", "write", "writev",
    // waiting, and sockets that are already connected
    "epoll_create1", "epoll_ctl", "epoll_pwait", "epoll_wait", "eventfd", "eventfd2", "getpeername",
    "getsockname", "getsockopt", "pipe", "pipe2", "poll", "ppoll", "pselect6", "recvfrom", "select",
    "sendto", "setsockopt", "shutdown", "timerfd_create", "timerfd_gettime", "timerfd_settime",
    // threads of this process; a rule below allows new ones
    "exit", "exit_group", "futex", "get_robust_list", "getcpu", "getpriority", "gettid", "rseq",
    "sched_get_priority_max", "sched_get_priority_min", "sched_getaffinity", "sched_getattr",
    "sched_getparam", "sched_getscheduler", "sched_setaffinity", "sched_setscheduler",
    "sched_yield", "set_robust_list", "set_tid_address",
    // signals of this process
    "pause", "restart_syscall", "rt_sigaction", "rt_sigpending", "rt_sigprocmask", "rt_sigreturn",
    "rt_sigsuspend", "rt_sigtimedwait", "sigaltstack",
    // time
    "clock_getres", "clock_gettime", "clock_nanosleep", "gettimeofday", "nanosleep", "time",
    "times",
    // facts that a process may know
    "arch_prctl", "getegid", "geteuid", "getgid", "getpgrp", "getpid", "getppid", "getrandom",
    "getresgid", "getresuid", "getrlimit", "getrusage", "getuid", "sysinfo", "uname"};

// Calls that a library may try; it then reports the failure. Unlisted calls give ENOSYS, as an
// older kernel would, and libraries fall back to an earlier call.
constexpr const char* kRefused[] = {"accept",
                                    "accept4",
                                    "bind",
                                    "chmod",
                                    "chown",
                                    "connect",
                                    "execve",
                                    "execveat",
                                    "fchmod",
                                    "fchmodat",
                                    "fchown",
                                    "fchownat",
                                    "fork",
                                    "fsetxattr",
                                    "lchown",
                                    "link",
                                    "linkat",
                                    "listen",
                                    "lsetxattr",
                                    "mknod",
                                    "mknodat",
                                    "pidfd_getfd",
                                    "pidfd_open",
                                    "recvmsg",
                                    "sendmsg",
                                    "setpgid",
                                    "setpriority",
                                    "setrlimit",
                                    "setsid",
                                    "setxattr",
                                    "socket",
                                    "socketpair",
                                    "symlink",
                                    "symlinkat",
                                    "tkill",
                                    "truncate",
                                    "umask",
                                    "utime",
                                    "utimensat",
                                    "utimes",
                                    "vfork",
                                    "rt_sigqueueinfo",
                                    "inotify_init1",
                                    "pidfd_send_signal",
                                    "rt_tgsigqueueinfo",
                                    "sched_setattr"};

// Calls that no library of a worker tries; they kill the process.
constexpr const char* kKilling[] = {"acct",
                                    "add_key",
                                    "bpf",
                                    "chroot",
                                    "clock_settime",
                                    "delete_module",
                                    "finit_module",
                                    "fsmount",
                                    "fsopen",
                                    "init_module",
                                    "io_uring_enter",
                                    "io_uring_setup",
                                    "ioperm",
                                    "iopl",
                                    "kexec_file_load",
                                    "kexec_load",
                                    "keyctl",
                                    "mount",
                                    "move_mount",
                                    "name_to_handle_at",
                                    "open_by_handle_at",
                                    "open_tree",
                                    "perf_event_open",
                                    "personality",
                                    "pivot_root",
                                    "process_madvise",
                                    "process_vm_readv",
                                    "process_vm_writev",
                                    "ptrace",
                                    "quotactl",
                                    "reboot",
                                    "request_key",
                                    "setdomainname",
                                    "setfsgid",
                                    "setfsuid",
                                    "setgid",
                                    "setgroups",
                                    "sethostname",
                                    "setns",
                                    "setregid",
                                    "setresgid",
                                    "setresuid",
                                    "setreuid",
                                    "settimeofday",
                                    "setuid",
                                    "swapoff",
                                    "swapon",
                                    "umount2",
                                    "unshare",
                                    "userfaultfd",
                                    "vhangup"};

#ifndef VOXELD_SANITIZED
// Options of prctl() that read, that change names, timers and huge pages of this process, or that
// restrict it. Others give ENOSYS, as unlisted calls do.
constexpr int kAllowedPrctl[] = {
    PR_CAPBSET_READ,   PR_GET_CHILD_SUBREAPER,  PR_GET_DUMPABLE,    PR_GET_KEEPCAPS,
    PR_GET_NAME,       PR_GET_NO_NEW_PRIVS,     PR_GET_PDEATHSIG,   PR_GET_SECCOMP,
    PR_GET_SECUREBITS, PR_GET_SPECULATION_CTRL, PR_GET_THP_DISABLE, PR_GET_TID_ADDRESS,
    PR_GET_TIMERSLACK, PR_GET_TIMING,           PR_GET_TSC,         PR_MCE_KILL_GET,
    PR_SET_NAME,       PR_SET_NO_NEW_PRIVS,     PR_SET_THP_DISABLE, PR_SET_TIMERSLACK,
    0x53564d41 /* PR_SET_VMA: names of mappings */};
#endif

using Filter = std::unique_ptr<void, decltype(&seccomp_release)>;

Error failed(const char* what, int code) {
  return {ErrorCode::kDeviceUnavailable,
          std::string("seccomp: ") + what + ": " + std::strerror(code < 0 ? -code : code), "", ""};
}

Result<Filter> make_filter(uint32_t by_default) {
  Filter filter(seccomp_init(by_default), seccomp_release);
  if (filter == nullptr) return failed("init", ENOMEM);
  for (const auto& [name, value] : {std::pair{SCMP_FLTATR_CTL_TSYNC, uint32_t{1}},
                                    std::pair{SCMP_FLTATR_ACT_BADARCH, SCMP_ACT_KILL_PROCESS},
                                    std::pair{SCMP_FLTATR_CTL_OPTIMIZE, uint32_t{2}}}) {
    if (const int code = seccomp_attr_set(filter.get(), name, value); code != 0) {
      return failed("attribute", code);
    }
  }
  return filter;
}

Status add(const Filter& filter, uint32_t action, const char* name,
           std::initializer_list<scmp_arg_cmp> arguments = {}) {
  const int number = seccomp_syscall_resolve_name(name);
  if (number == __NR_SCMP_ERROR || number < 0) return {};  // not on this architecture
  const int code = seccomp_rule_add_array(
      filter.get(), action, number, static_cast<unsigned>(arguments.size()), arguments.begin());
  return code == 0 ? Status() : Status(failed(name, code));
}

scmp_arg_cmp masked(unsigned argument, uint64_t mask, uint64_t value) {
  return {argument, SCMP_CMP_MASKED_EQ, mask, value};
}
scmp_arg_cmp is_int(unsigned argument, uint64_t value) {
  return masked(argument, kLow32Bits, value & kLow32Bits);
}

#ifndef VOXELD_SANITIZED
// Calls that are allowed for some arguments.
Status add_conditional(const Filter& filter) {
  // clone() with CLONE_THREAD makes a thread; without it, a process. The flags of clone3() are in
  // memory, where a filter cannot look. It gives ENOSYS, and glibc falls back to clone().
  VOXELD_TRY(add(filter, SCMP_ACT_ALLOW, "clone", {masked(0, CLONE_THREAD, CLONE_THREAD)}));
  const auto self = static_cast<uint64_t>(::getpid());
  for (const char* name : {"kill", "tgkill"}) {
    VOXELD_TRY(add(filter, SCMP_ACT_ALLOW, name, {is_int(0, self)}));
  }
  VOXELD_TRY(add(filter, SCMP_ACT_ALLOW, "prlimit64", {masked(2, ~uint64_t{0}, 0)}));  // reading
  for (const int option : kAllowedPrctl) {
    VOXELD_TRY(add(filter, SCMP_ACT_ALLOW, "prctl", {is_int(0, static_cast<uint64_t>(option))}));
  }
  return {};
}
#endif

Result<Filter> allow_list() {
  VOXELD_ASSIGN(Filter filter, make_filter(SCMP_ACT_ERRNO(ENOSYS)));
  for (const char* name : kAllowed) VOXELD_TRY(add(filter, SCMP_ACT_ALLOW, name));
  for (const char* name : kRefused) VOXELD_TRY(add(filter, SCMP_ACT_ERRNO(EPERM), name));
#ifdef VOXELD_SANITIZED
  // The leak check at exit stops the process's threads by tracing them from a clone.
  for (const char* name : {"clone", "ptrace", "prctl", "wait4", "kill", "tgkill", "personality"}) {
    VOXELD_TRY(add(filter, SCMP_ACT_ALLOW, name));
  }
  for (const char* name : kKilling) {
    if (std::string_view(name) == "ptrace" || std::string_view(name) == "personality") continue;
    VOXELD_TRY(add(filter, SCMP_ACT_KILL_PROCESS, name));
  }
#else
  for (const char* name : kKilling) VOXELD_TRY(add(filter, SCMP_ACT_KILL_PROCESS, name));
  VOXELD_TRY(add_conditional(filter));
#endif
  return filter;
}

// A second filter, because libseccomp does not combine rules with arguments and one without. The
// stricter of the two results counts.
Result<Filter> deny_list() {
  VOXELD_ASSIGN(Filter filter, make_filter(SCMP_ACT_ALLOW));
  const uint32_t refused = SCMP_ACT_ERRNO(EPERM);
  // Refuses ioctls that put text into the daemon's terminal, or that signal any process of the same
  // user when a descriptor is ready.
  for (const uint64_t request :
       {uint64_t{TIOCSTI}, uint64_t{TIOCLINUX}, uint64_t{FIOSETOWN}, uint64_t{SIOCSPGRP}}) {
    VOXELD_TRY(add(filter, refused, "ioctl", {is_int(1, request)}));
  }
  for (const int command : {F_SETOWN, F_SETOWN_EX, F_SETSIG, F_SETLEASE, F_NOTIFY}) {
    VOXELD_TRY(add(filter, refused, "fcntl", {is_int(1, static_cast<uint64_t>(command))}));
  }
  // Before ABI 3, Landlock does not notice O_TRUNC when a file is opened for reading.
  constexpr uint64_t kAsked = O_TRUNC | O_ACCMODE;
  VOXELD_TRY(add(filter, refused, "open", {masked(1, kAsked, O_TRUNC)}));
  VOXELD_TRY(add(filter, refused, "openat", {masked(2, kAsked, O_TRUNC)}));
  return filter;
}

}  // namespace

bool seccomp_available() {
  return ::prctl(PR_GET_SECCOMP, 0, 0, 0, 0) >= 0 && seccomp_api_get() >= 2;  // 2: TSYNC
}

Status restrict_calls() {
  VOXELD_ASSIGN(const Filter denied, deny_list());
  VOXELD_ASSIGN(const Filter allowed, allow_list());
  // The denying filter first: the second load needs seccomp(), which the allow-list forbids.
  if (const int code = seccomp_load(denied.get()); code != 0) return failed("load", code);
  if (const int code = seccomp_load(allowed.get()); code != 0) return failed("load", code);
  return {};
}

Status restrict_resources() {
  for (const auto& [which, value] : {std::pair<int, rlim_t>{RLIMIT_CORE, 0},
                                     {RLIMIT_NOFILE, kDescriptorsMax},
                                     {RLIMIT_FSIZE, kFileBytesMax}}) {
    rlimit limit{};
    if (::getrlimit(static_cast<__rlimit_resource_t>(which), &limit) != 0) {
      return errno_error("read", "a resource limit");
    }
    limit.rlim_cur = std::min(limit.rlim_cur, value);
    limit.rlim_max = std::min(limit.rlim_max, value);
    if (::setrlimit(static_cast<__rlimit_resource_t>(which), &limit) != 0) {
      return errno_error("set", "a resource limit");
    }
  }
  ::signal(SIGXFSZ, SIG_IGN);  // a too long file gives EFBIG instead
  return {};
}

}  // namespace voxeld
