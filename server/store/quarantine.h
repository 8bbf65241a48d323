// DIR/quarantine/DAY/sha256-…: blobs that no row of the database named. They are kept for days,
// because a database that was restored, removed or rebuilt may not know what was uploaded.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"

namespace voxeld {

// "2026-11-22", in UTC.
std::string day_text(int64_t unix_ms);

struct QuarantinedBlob {
  std::string id;
  std::filesystem::path path;
};

// Holds no state: the folders are. Calls that move a blob belong to its store (BlobStore), which
// knows what is pinned.
class Quarantine {
 public:
  explicit Quarantine(const std::filesystem::path& data_dir) : folder_(data_dir / "quarantine") {}
  // Moves a file to the folder of the day. Errors: internal, storage-full.
  Status take(const std::filesystem::path& blob, std::string_view day) const;
  // All of them, the newest day first.
  Result<std::vector<QuarantinedBlob>> list() const;
  // Removes what was moved before `day`, and empty folders. Returns the number of files. A folder
  // whose name is no day stays.
  Result<int64_t> remove_before(std::string_view day) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace voxeld
