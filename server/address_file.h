// The address file of a daemon (--address-file): how programs on the same machine find it when it
// listens on a free port.
//
//   {"url": "http://127.0.0.1:43210", "pid": 1234}
//
// Mode 0600. The daemon holds a lock (flock, exclusive) on the file for as long as it serves, so
// that the file of a killed daemon is told from that of a live one by trying a shared lock.
#pragma once

#include <filesystem>
#include <string>

#include "proto/result.h"
#include "server/base/disk/file.h"

namespace voxeld {

class AddressFile {
 public:
  // Replaces a file that is there. Errors: internal, storage-full.
  static Result<AddressFile> write(const std::filesystem::path& path, const std::string& url);
  AddressFile(AddressFile&&) noexcept = default;
  AddressFile& operator=(AddressFile&&) = delete;
  ~AddressFile() { remove(); }

  // Idempotent. Leaves a file that another process has put in its place.
  void remove();

 private:
  AddressFile(std::filesystem::path path, UniqueFd fd)
      : path_(std::move(path)), fd_(std::move(fd)) {}

  std::filesystem::path path_;
  UniqueFd fd_;  // holds the lock; empty: removed
};

}  // namespace voxeld
