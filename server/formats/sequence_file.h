// A file that grows from its beginning to its end, and whose first bytes are known last.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "proto/result.h"
#include "server/base/file.h"

namespace voxeld {

class SequenceFile {
 public:
  // Created or replaced. Errors: storage-full, internal.
  static Result<SequenceFile> create(const std::filesystem::path& path);

  Status append(std::span<const uint8_t> bytes);
  // Over what stands there; it must lie in what was appended.
  Status replace(uint64_t offset, std::span<const uint8_t> bytes);
  uint64_t size() const { return size_; }

 private:
  SequenceFile(UniqueFd file, std::filesystem::path path)
      : file_(std::move(file)), path_(std::move(path)) {}

  UniqueFd file_;
  std::filesystem::path path_;
  uint64_t size_ = 0;
};

}  // namespace voxeld
