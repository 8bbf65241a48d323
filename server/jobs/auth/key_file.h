// DIR/keys: the API keys as a text file of their own. Not in the job database: `voxeld keys` works
// while the daemon runs, and SQLite before 3.51.3 can corrupt a database that two processes write.
//
//   # voxeld keys 1: id tenant hash created_ms expires_ms revoked_ms weight role
//       requests_per_minute queued_jobs bytes cells
//   k3v7qz2m lab sha256-9f86d081… 1763778000000 0 0 1 tenant 600 100 4294967296 0
//
// (the head is one line). Fields stand between single spaces, every line ends in a line feed; times
// are Unix milliseconds, 0: never; the role is `tenant` or `admin`; a limit of 0 is none. Revoked
// and expired keys keep their line, so that a daemon whose last key went does not become open. The
// file is replaced as a whole (rename), its mode is 0600, its owner that of the directory, and
// DIR/keys.lock is locked meanwhile.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/jobs/auth/api_key.h"

namespace voxeld {

using KeyList = std::vector<ApiKey>;

std::filesystem::path key_file_path(const std::filesystem::path& data_dir);

// `file` goes into errors: "keys line 3: weight: expected 1 to 1000, got 0".
Result<KeyList> parse_keys(std::string_view text, const std::string& file);
std::string keys_text(const KeyList& keys);

// nullopt: there is no such file. Errors: internal, with file and line where it is not what
// keys_text() writes; those of read_private().
Result<std::optional<KeyList>> read_keys(const std::filesystem::path& file);

// The key whose limits and weight are the tenant's, of those that are live then; null where it has
// none.
const ApiKey* newest_key(const KeyList& keys, std::string_view tenant,
                         std::optional<int64_t> live_at_ms = std::nullopt);

// Reads the list (without a file: an empty one), lets `change` work on it and puts it in the file's
// place, synced. The directory is made where it is missing. Errors: those of read_keys() and of
// `change`, conflict while another process changes it, storage-full.
Status change_keys(const std::filesystem::path& data_dir,
                   const std::function<Status(KeyList&)>& change);

}  // namespace voxeld
