// A file, or bytes in memory, that an encoder writes: front to back, or pieces in any order where
// their lengths are known.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <utility>
#include <vector>

#include "proto/result.h"
#include "server/base/disk/file.h"

namespace voxeld {

class OutputFile {
 public:
  // Creates or replaces the file. Errors: storage-full, internal.
  static Result<OutputFile> create(const std::filesystem::path& path);
  // Keeps the bytes in memory, for take_bytes().
  static OutputFile in_memory() { return OutputFile(UniqueFd()); }

  // Errors of these: storage-full, internal.
  Status append(std::span<const uint8_t> bytes);
  // Appends zeros.
  Status extend(uint64_t bytes);
  // Overwrites bytes that were appended before. Thread-safe for ranges that do not overlap.
  Status replace(uint64_t offset, std::span<const uint8_t> bytes);
  uint64_t size() const { return size_; }
  std::vector<uint8_t> take_bytes() { return std::move(memory_); }

 private:
  explicit OutputFile(UniqueFd file) : file_(std::move(file)) {}

  UniqueFd file_;
  std::vector<uint8_t> memory_;  // without a file
  uint64_t size_ = 0;
};

}  // namespace voxeld
