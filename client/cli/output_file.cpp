#include "client/cli/output_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "client/include/voxeld/client.h"

namespace voxeld::cli {
namespace {

constexpr int kPartNamesMax = 100;  // names that are tried for a part

std::filesystem::path linked_path(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::path target = std::filesystem::read_symlink(path, error);
  return error ? path : path.parent_path() / target;
}

}  // namespace

OutputFile::OutputFile(const std::string& path) : path_(path) {
  if (path == "-") {
    file_ = stdout;
    return;
  }
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  // A device or a pipe (/dev/null, a fifo) must not be replaced by a new file.
  const bool is_special =
      std::filesystem::exists(status) && !std::filesystem::is_regular_file(status);
  if (is_special) {
    file_ = std::fopen(path.c_str(), "wb");
  } else {
    // A link stays a link to the file, also to one that is not there yet.
    const std::filesystem::path real = std::filesystem::canonical(path, error);
    target_ = error ? linked_path(path) : real;
    // A process of this number may have left one: the first of a container always has the same.
    const std::string part = target_.string() + ".part-" + std::to_string(getpid());
    for (int i = 0; file_ == nullptr && i < kPartNamesMax && (i == 0 || errno == EEXIST); ++i) {
      part_ = i == 0 ? part : part + "-" + std::to_string(i);
      file_ = std::fopen(part_.c_str(), "wbx");
    }
  }
  if (file_ == nullptr) {
    part_.clear();
    fail("cannot be written");
  }
}

OutputFile::~OutputFile() {
  if (file_ != nullptr && file_ != stdout) std::fclose(file_);
  std::error_code ignored;
  if (!part_.empty()) std::filesystem::remove(part_, ignored);
}

void OutputFile::fail(const char* what) const {
  throw client::Error("file", 0,
                      (path_ == "-" ? "stdout" : path_) + " " + what + ": " + std::strerror(errno));
}

void OutputFile::write(std::span<const std::byte> piece) {
  if (std::fwrite(piece.data(), 1, piece.size(), file_) != piece.size()) fail("cannot be written");
  bytes_ += piece.size();
}

void OutputFile::keep() {
  if (std::fflush(file_) != 0) fail("cannot be written");
  if (file_ == stdout) return;
  const int closed = std::fclose(file_);
  file_ = nullptr;
  if (closed != 0) fail("cannot be written");
  if (part_.empty()) return;
  if (std::rename(part_.c_str(), target_.c_str()) != 0) fail("cannot be replaced");
  part_.clear();
}

}  // namespace voxeld::cli
