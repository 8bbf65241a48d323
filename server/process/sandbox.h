// A sandbox for a process that reads untrusted bytes: it gives up files (Landlock), system calls
// (seccomp) and resources. Nothing of it can be undone, and children inherit it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "proto/result.h"

namespace voxeld {

// A directory tree or file that stays accessible.
struct FileRule {
  enum class Access {
    kRead,
    kReadWrite,  // existing files
    kOutput,     // also create and remove plain files, and rename among them
    kDevice,     // read, write and ioctl
    // Create, read, write and remove plain files, but not list them. Files of other processes can
    // be opened by their names.
    kSharedMemory,
  };
  std::filesystem::path path;
  Access access = Access::kRead;
};

// The version of Landlock; 0: the kernel lacks it, or it is switched off.
int landlock_abi();

// Restricts this thread, and threads that it starts, to the files of `rules`. They also can no
// longer signal or inspect processes outside the sandbox. Threads that run already are not
// restricted, because Landlock has no call for that: call it before the first thread. Paths that do
// not exist are ignored. Open files stay open. Errors: device-unavailable if the kernel cannot.
Status restrict_files(const std::vector<FileRule>& rules);

// Restricts this process, with all its threads, to the system calls that computing, drivers and
// their files need. It cannot make new sockets or processes, signal others, or change owners, modes
// and links. Calls that only an attack would make kill the process. The others fail with EPERM, or
// with ENOSYS so that libraries fall back. Errors: as above.
Status restrict_calls();
// Whether this kernel supports restrict_calls().
bool seccomp_available();

// Forbids core dumps and limits descriptors and file size.
Status restrict_resources();

}  // namespace voxeld
