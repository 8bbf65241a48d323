// What a process gives up before it touches bytes of strangers: files (Landlock), system calls
// (seccomp) and some limits. None of it can be taken back, and children inherit all of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "proto/result.h"

namespace voxeld {

// One hierarchy, or one file, that stays reachable.
struct FileRule {
  enum class Access {
    kRead,
    kReadWrite,  // what exists
    kOutput,     // also make and remove plain files, and rename among them
    kDevice,     // read, write and ioctl
  };
  std::filesystem::path path;
  Access access = Access::kRead;
};

// 0: the kernel has no Landlock, or it is switched off.
int landlock_abi();

// From now on this thread, and those that it starts, reach the files of `rules` alone, and give no
// signal to and look into no process from before. Threads that run already are not bound by it:
// Landlock has no call for those, so this comes before the first thread. Paths that do not exist
// are left out. Files that are open already stay so. Errors: device-unavailable where the kernel
// cannot.
Status restrict_files(const std::vector<FileRule>& rules);

// From now on this process, with the threads that it has, does no other system calls than those
// that computing, drivers and their files need: no new sockets, no new processes, no signals to
// others, no change of owners, modes and links. What only an attack would try kills the process;
// the rest fails with EPERM, or with ENOSYS so that libraries fall back. Errors: as above.
Status restrict_calls();
// Whether this kernel has what restrict_calls() needs.
bool seccomp_available();

// No dumped core, few descriptors, and no file that fills a disk.
Status restrict_resources();

}  // namespace voxeld
