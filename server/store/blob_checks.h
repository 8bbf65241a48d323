// Remembers which blobs have the bytes that their names promise, as far as this process has read
// them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>

#include "proto/result.h"
#include "server/base/thread_annotations.h"

namespace voxeld {

// The attributes of a file that change when someone writes to it, truncates or replaces it. The
// inode's change time is excluded: tasks that read blobs make and remove links to them.
struct FileStamp {
  uint64_t device = 0;
  uint64_t inode = 0;
  int64_t bytes = 0;
  int64_t modified_ns = 0;
  bool operator==(const FileStamp&) const = default;
};

// Errors: not-found; internal.
Result<FileStamp> stamp_of(const std::filesystem::path& path);

// Thread-safe. Remembers results until the file's stamp changes, so a file is read once.
class BlobChecks {
 public:
  struct Found {
    FileStamp stamp;
    bool is_intact = false;
  };
  // Whether the file's SHA-256 is its id. Blocks while another thread reads the same blob. Errors:
  // not-found; internal if it cannot be read.
  Result<Found> check(const std::string& id, const std::filesystem::path& path) EXCLUDES(mutex_);
  // The remembered result, without reading.
  std::optional<bool> known(const std::string& id, const FileStamp& stamp) EXCLUDES(mutex_);
  // Records that these very bytes were just hashed.
  void note_intact(const std::string& id, const std::filesystem::path& path) EXCLUDES(mutex_);
  // How often a damaged blob was found.
  int64_t damaged_count() const EXCLUDES(mutex_);

 private:
  void note(const std::string& id, const Found& found) EXCLUDES(mutex_);
  mutable Mutex mutex_;
  CondVar changed_;
  std::unordered_map<std::string, Found> found_ GUARDED_BY(mutex_);
  std::set<std::string, std::less<>> reading_ GUARDED_BY(mutex_);
  int64_t damaged_ GUARDED_BY(mutex_) = 0;
};

// The id "sha256-…" of the rest of an open file, and the number of bytes.
Result<std::pair<std::string, int64_t>> hash_file(int fd, const std::filesystem::path& path);

}  // namespace voxeld
