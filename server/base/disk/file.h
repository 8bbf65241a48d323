// Files and descriptors: whole-file reads, mapped input, durable renames.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "proto/result.h"

namespace voxeld {

// Owns a file descriptor; -1 is empty.
class UniqueFd {
 public:
  UniqueFd() = default;
  explicit UniqueFd(int fd) : fd_(fd) {}
  ~UniqueFd() { reset(); }
  UniqueFd(UniqueFd&& other) noexcept : fd_(other.release()) {}
  UniqueFd& operator=(UniqueFd&& other) noexcept {
    if (this != &other) reset(other.release());
    return *this;
  }
  int get() const { return fd_; }
  bool valid() const { return fd_ >= 0; }
  int release() {
    const int fd = fd_;
    fd_ = -1;
    return fd;
  }
  void reset(int fd = -1);

 private:
  int fd_ = -1;
};

// A file mapped read-only; empty files give an empty span.
class MappedFile {
 public:
  static Result<MappedFile> open(const std::filesystem::path& path);
  MappedFile() = default;
  ~MappedFile();
  MappedFile(MappedFile&& other) noexcept;
  MappedFile& operator=(MappedFile&& other) noexcept;
  std::span<const uint8_t> bytes() const { return {data_, size_}; }

 private:
  const uint8_t* data_ = nullptr;
  size_t size_ = 0;
};

Result<std::vector<uint8_t>> read_file(const std::filesystem::path& path);
// Writes a file without sync; for scratch files. Errors: storage-full on ENOSPC and EDQUOT, else
// internal.
Status write_file(const std::filesystem::path& path, std::span<const uint8_t> bytes);
// Calls write(2) until everything is written; retries after EINTR. Errors: as write_file(), and
// storage-full below the process's reserve (disk_reserve.h).
Status write_all(int fd, std::span<const uint8_t> bytes);
// The same, with a cancellation point for each few megabytes (cancel_point.h).
Status write_in_pieces(int fd, std::span<const uint8_t> bytes);
// Syncs a file, or a directory so that a rename in it survives power loss.
Status sync_path(const std::filesystem::path& path);
// An Error from errno: "<action> <path>: <strerror>"; storage-full for ENOSPC and EDQUOT.
Error errno_error(std::string_view action, const std::filesystem::path& path);
// The same from an error code of std::filesystem.
Error code_error(std::string_view action, const std::filesystem::path& path,
                 const std::error_code& code);

}  // namespace voxeld
