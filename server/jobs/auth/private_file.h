// Small text files of secrets in the data directory: replaced as a whole (rename), mode 0600, owned
// by who owns the directory, changed under a lock of their own.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "proto/result.h"
#include "server/base/disk/file.h"

namespace voxeld {

// Tells a file that was replaced from the one before.
struct FileMark {
  bool exists = false;
  uint64_t inode = 0;
  int64_t bytes = 0, changed_s = 0, changed_ns = 0;
  bool operator==(const FileMark&) const = default;
};
FileMark mark_of(const std::filesystem::path& file);

// nullopt: there is no such file. Errors: internal, also for what is no file; conflict for one that
// belongs to another user or that others may read or write (check_secret()).
Result<std::optional<std::string>> read_private(const std::filesystem::path& file);
// Puts `text` in the file's place, synced. Errors: internal, storage-full.
Status replace_private(const std::filesystem::path& file, const std::string& text);
// Holds `file`.lock, for which it waits a moment; makes the directory where it is missing. Errors:
// conflict while another process has it.
Result<UniqueFd> lock_private(const std::filesystem::path& file);

}  // namespace voxeld
