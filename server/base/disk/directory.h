// Directories: listing, removal, locks that last until the process ends, and checks of the owner
// and mode of what the daemon trusts. The iterators of std::filesystem are not used: they are
// noexcept but allocate, so they end the process when memory runs out.
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/base/disk/file.h"

namespace voxeld {

// Makes a directory of mode 0700 that survives power loss. An existing one is no error.
Status make_directory(const std::filesystem::path& path);
// Names in a directory, without . and .., in no order. Empty if the directory does not exist.
Result<std::vector<std::string>> directory_names(const std::filesystem::path& directory);
// Removes the directory with all its contents, whatever their depth and mode, as far as possible.
void remove_tree(const std::filesystem::path& directory) noexcept;

// More entries than a worker's folders or a driver's cache have. Limits the time of tree_bytes()
// and the names that it holds.
constexpr int64_t kTreeEntriesMax = 20'000;
// Bytes that all files and directories below this one take on its disk, whatever their depth and
// mode; 0 if it does not exist. Its owner may change it meanwhile. Errors: internal for more
// than kTreeEntriesMax entries, for a directory that cannot be read, and for directories that are
// moved elsewhere each time they are measured.
Result<int64_t> tree_bytes(const std::filesystem::path& directory);

// Bytes that one file or directory takes on its disk.
inline int64_t disk_bytes(const struct stat& info) {
  constexpr int64_t kUnit = 512;  // of st_blocks, whatever the file system's blocks are
  return static_cast<int64_t>(info.st_blocks) * kUnit;
}

// Creates the file, locks it (flock) and writes this process's pid into it. The lock lasts as long
// as the descriptor. Waits up to 5 s for a child that a killed holder was just starting. Errors:
// conflict with the other process's pid if it is taken.
Result<UniqueFd> lock_file(const std::filesystem::path& path);
// Locks a directory. Removing a file in it cannot circumvent this lock. DIR/lock holds the pid.
Result<UniqueFd> lock_directory(const std::filesystem::path& directory);
// Whether some process holds lock_directory().
bool is_directory_locked(const std::filesystem::path& directory);

// Checks that it belongs to this process's user or to root, and that no other user can write to it.
// Errors: conflict, with the command that repairs it.
Status check_trusted(const struct stat& info, const std::filesystem::path& path);
// The same for a secret, which no other user may read either. `owner`: a further user who may own
// it.
Status check_secret(const struct stat& info, const std::filesystem::path& path, uid_t owner);

}  // namespace voxeld
