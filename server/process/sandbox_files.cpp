#include <fcntl.h>
#include <linux/landlock.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>

#include "server/base/disk/file.h"
#include "server/process/sandbox.h"

// Constants of kernels later than the headers of Debian 12, which end at ABI 2.
#ifndef LANDLOCK_ACCESS_FS_TRUNCATE
#define LANDLOCK_ACCESS_FS_TRUNCATE (1ULL << 14)
#endif
#ifndef LANDLOCK_ACCESS_FS_IOCTL_DEV
#define LANDLOCK_ACCESS_FS_IOCTL_DEV (1ULL << 15)
#endif

namespace voxeld {
namespace {

// The landlock_ruleset_attr of ABI 6. An older kernel accepts the longer struct if the fields it
// does not know are 0.
struct RulesetAttributes {
  uint64_t handled_access_fs = 0;
  uint64_t handled_access_net = 0;
  uint64_t scoped = 0;
};

constexpr int kAbiRefer = 2, kAbiTruncate = 3, kAbiNet = 4, kAbiIoctl = 5, kAbiScope = 6;
constexpr uint64_t kNetBindConnectTcp = 3;
constexpr uint64_t kScopeAbstractSocketsAndSignals = 3;

constexpr uint64_t kReadAccess = LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR;
constexpr uint64_t kWriteAccess = LANDLOCK_ACCESS_FS_WRITE_FILE | LANDLOCK_ACCESS_FS_TRUNCATE;
constexpr uint64_t kOutputAccess = LANDLOCK_ACCESS_FS_MAKE_REG | LANDLOCK_ACCESS_FS_REMOVE_FILE |
                                   LANDLOCK_ACCESS_FS_MAKE_DIR | LANDLOCK_ACCESS_FS_REMOVE_DIR |
                                   LANDLOCK_ACCESS_FS_REFER;
// Rights that a rule on a plain file may have.
constexpr uint64_t kFileAccess = LANDLOCK_ACCESS_FS_EXECUTE | LANDLOCK_ACCESS_FS_READ_FILE |
                                 kWriteAccess | LANDLOCK_ACCESS_FS_IOCTL_DEV;

uint64_t handled_accesses(int abi) {
  uint64_t all = LANDLOCK_ACCESS_FS_MAKE_SYM;  // the highest of ABI 1
  all |= all - 1;
  if (abi >= kAbiRefer) all |= LANDLOCK_ACCESS_FS_REFER;
  if (abi >= kAbiTruncate) all |= LANDLOCK_ACCESS_FS_TRUNCATE;
  if (abi >= kAbiIoctl) all |= LANDLOCK_ACCESS_FS_IOCTL_DEV;
  return all;
}

uint64_t accesses_of(FileRule::Access access) {
  switch (access) {
    case FileRule::Access::kRead:
      return kReadAccess;
    case FileRule::Access::kReadWrite:
      return kReadAccess | kWriteAccess;
    case FileRule::Access::kOutput:
      return kReadAccess | kWriteAccess | kOutputAccess;
    case FileRule::Access::kDevice:
      return kReadAccess | kWriteAccess | LANDLOCK_ACCESS_FS_IOCTL_DEV;
    case FileRule::Access::kSharedMemory:
      return LANDLOCK_ACCESS_FS_READ_FILE | kWriteAccess | LANDLOCK_ACCESS_FS_MAKE_REG |
             LANDLOCK_ACCESS_FS_REMOVE_FILE;
  }
  return 0;
}

Error unavailable(const std::string& what) {
  return {ErrorCode::kDeviceUnavailable, what, "", ""};
}

Status add_rule(int ruleset, const FileRule& rule, uint64_t handled) {
  const UniqueFd fd(::open(rule.path.c_str(), O_PATH | O_CLOEXEC));
  if (!fd.valid()) {
    if (errno == ENOENT || errno == ENOTDIR || errno == EACCES) return {};
    return errno_error("restrict files to", rule.path);
  }
  struct stat info {};
  if (::fstat(fd.get(), &info) != 0) return errno_error("stat", rule.path);
  landlock_path_beneath_attr beneath{};
  beneath.allowed_access = accesses_of(rule.access) & handled;
  if (!S_ISDIR(info.st_mode)) beneath.allowed_access &= kFileAccess;
  beneath.parent_fd = fd.get();
  if (::syscall(SYS_landlock_add_rule, ruleset, LANDLOCK_RULE_PATH_BENEATH, &beneath, 0) != 0) {
    return errno_error("restrict files to", rule.path);
  }
  return {};
}

}  // namespace

int landlock_abi() {
  const long abi =
      ::syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
  return abi < 0 ? 0 : static_cast<int>(abi);
}

Status restrict_files(const std::vector<FileRule>& rules) {
  const int abi = landlock_abi();
  if (abi == 0) return unavailable("the kernel has no Landlock (or no lsm=landlock)");
  RulesetAttributes attributes;
  attributes.handled_access_fs = handled_accesses(abi);
  if (abi >= kAbiNet) attributes.handled_access_net = kNetBindConnectTcp;
  if (abi >= kAbiScope) attributes.scoped = kScopeAbstractSocketsAndSignals;
  const UniqueFd ruleset(
      static_cast<int>(::syscall(SYS_landlock_create_ruleset, &attributes, sizeof attributes, 0)));
  if (!ruleset.valid()) return errno_error("make", "a Landlock ruleset");
  for (const FileRule& rule : rules) {
    VOXELD_TRY(add_rule(ruleset.get(), rule, attributes.handled_access_fs));
  }
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return errno_error("set", "no_new_privs");
  if (::syscall(SYS_landlock_restrict_self, ruleset.get(), 0) != 0) {
    return errno_error("enter", "a Landlock ruleset");
  }
  return {};
}

}  // namespace voxeld
