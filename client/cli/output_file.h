// The output of a command: a file that appears only when it is complete, or stdout.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <span>
#include <string>

namespace voxeld::cli {

// Throws client::Error "file" (what, where, why) if something cannot be written.
class OutputFile {
 public:
  // "-" is stdout.
  explicit OutputFile(const std::string& path);
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile();  // removes an unfinished file

  void write(std::span<const std::byte> piece);
  // Call it after the last piece: gives the file its name and replaces an existing file.
  void keep();
  std::uint64_t bytes() const { return bytes_; }

 private:
  [[noreturn]] void fail(const char* what) const;

  std::string path_;
  std::filesystem::path target_;  // what path_ leads to
  std::filesystem::path
      part_;  // written next to target_, renamed at the end; empty: written directly
  std::FILE* file_ = nullptr;
  std::uint64_t bytes_ = 0;
};

}  // namespace voxeld::cli
