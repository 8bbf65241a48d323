// The output of a command: a file that appears only when it is complete, or stdout.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <stop_token>
#include <string>

namespace voxeld::cli {

// Throws client::Error "file" (what, where, why) if something cannot be written, "interrupted" if a
// stop is requested while a pipe, a terminal or a socket takes nothing.
class OutputFile {
 public:
  // "-" is stdout.
  OutputFile(const std::string& path, std::stop_token stop);
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile();  // removes an unfinished file

  void write(std::span<const std::byte> piece);
  // Call it after the last piece: gives the file its name and replaces an existing file.
  void keep();
  std::uint64_t bytes() const { return bytes_; }

 private:
  void open();
  void check_stop() const;
  [[noreturn]] void fail(const char* what) const;

  std::string path_;
  std::stop_token stop_;
  std::filesystem::path target_;  // what path_ leads to
  std::filesystem::path
      part_;  // written next to target_, renamed at the end; empty: written directly
  int descriptor_ = -1;
  bool is_stream_ = false;  // no file of a disk
  std::uint64_t bytes_ = 0;
};

}  // namespace voxeld::cli
