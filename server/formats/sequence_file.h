// A file, or bytes in memory, that is written front to back, and whose first bytes are known last.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <utility>
#include <vector>

#include "proto/result.h"
#include "server/base/file.h"

namespace voxeld {

class SequenceFile {
 public:
  // Creates or replaces the file. Errors: storage-full, internal.
  static Result<SequenceFile> create(const std::filesystem::path& path);
  // Keeps the bytes in memory, for take_bytes().
  static SequenceFile in_memory() { return {UniqueFd(), {}}; }

  Status append(std::span<const uint8_t> bytes);
  // Overwrites bytes that were appended before.
  Status replace(uint64_t offset, std::span<const uint8_t> bytes);
  uint64_t size() const { return size_; }
  std::vector<uint8_t> take_bytes() { return std::move(memory_); }

 private:
  SequenceFile(UniqueFd file, std::filesystem::path path)
      : file_(std::move(file)), path_(std::move(path)) {}

  UniqueFd file_;
  std::filesystem::path path_;
  std::vector<uint8_t> memory_;  // without a file
  uint64_t size_ = 0;
};

}  // namespace voxeld
