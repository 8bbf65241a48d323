// Quarantined blobs, which no row of the database named: DIR/quarantine/DAY/sha256-…. They are kept
// for days, because a restored, removed or rebuilt database may not know all uploads.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"

namespace voxeld {

// A day in UTC, such as "2026-11-22".
std::string day_text(int64_t unix_ms);

struct QuarantinedBlob {
  std::string id;
  std::filesystem::path path;
};

// Has no state but its folders. BlobStore moves blobs in and out, because it knows the pins.
class Quarantine {
 public:
  explicit Quarantine(const std::filesystem::path& data_dir) : folder_(data_dir / "quarantine") {}
  // Moves a file to the folder of the day. Errors: internal, storage-full.
  Status take(const std::filesystem::path& blob, std::string_view day) const;
  // All quarantined blobs, the newest day first.
  Result<std::vector<QuarantinedBlob>> list() const;
  // Removes files moved before `day`, and empty folders. Returns the number of files. A folder
  // whose name is not a day stays.
  Result<int64_t> remove_before(std::string_view day) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace voxeld
