#include "client/cli/output_file.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstring>
#include <thread>
#include <utility>

#include "client/include/voxeld/client.h"
#include "proto/part_file.h"

namespace voxeld::cli {
namespace {

constexpr std::chrono::milliseconds kStopLook{50};  // between two looks at the stop token

std::filesystem::path linked_path(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::path target = std::filesystem::read_symlink(path, error);
  return error ? path : path.parent_path() / target;
}

}  // namespace

OutputFile::OutputFile(const std::string& path, std::stop_token stop)
    : path_(path), stop_(std::move(stop)) {
  if (path == "-") {
    descriptor_ = STDOUT_FILENO;
  } else {
    open();
  }
  struct stat info {};
  is_stream_ = ::fstat(descriptor_, &info) == 0 && !S_ISREG(info.st_mode);
}

void OutputFile::open() {
  std::error_code error;
  const auto status = std::filesystem::status(path_, error);
  // A device or a pipe (/dev/null, a fifo) must not be replaced by a new file.
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    // An open that waits for who reads a fifo would not notice a stop.
    while ((descriptor_ = ::open(path_.c_str(), O_WRONLY | O_CLOEXEC | O_NONBLOCK)) < 0 &&
           errno == ENXIO && std::filesystem::is_fifo(status)) {
      check_stop();
      std::this_thread::sleep_for(kStopLook);
    }
  } else {
    // A link stays a link to the file, also to one that is not there yet.
    const std::filesystem::path real = std::filesystem::canonical(path_, error);
    target_ = error ? linked_path(path_) : real;
    descriptor_ = create_part(target_, part_);
  }
  if (descriptor_ >= 0) return;
  part_.clear();
  fail("cannot be written");
}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0 && descriptor_ != STDOUT_FILENO) ::close(descriptor_);
  std::error_code ignored;
  if (!part_.empty()) std::filesystem::remove(part_, ignored);
}

void OutputFile::fail(const char* what) const {
  throw client::Error("file", 0,
                      (path_ == "-" ? "stdout" : path_) + " " + what + ": " + std::strerror(errno));
}

void OutputFile::check_stop() const {
  if (stop_.stop_requested()) throw client::Error("interrupted", 0, "stopped by the caller");
}

void OutputFile::write(std::span<const std::byte> piece) {
  while (!piece.empty()) {
    size_t count = piece.size();
    if (is_stream_) {
      // So much does not wait once there is room; a write that waits would not notice a stop.
      count = std::min<size_t>(count, PIPE_BUF);
      pollfd output{descriptor_, POLLOUT, 0};
      while (::poll(&output, 1, static_cast<int>(kStopLook.count())) == 0) check_stop();
    }
    const ssize_t written = ::write(descriptor_, piece.data(), count);
    if (written < 0) {
      if (errno == EAGAIN || errno == EINTR) continue;
      fail("cannot be written");
    }
    piece = piece.subspan(static_cast<size_t>(written));
    bytes_ += static_cast<std::uint64_t>(written);
  }
}

void OutputFile::keep() {
  if (descriptor_ == STDOUT_FILENO) return;
  const int closed = ::close(std::exchange(descriptor_, -1));
  if (closed != 0) fail("cannot be written");
  if (part_.empty()) return;
  if (std::rename(part_.c_str(), target_.c_str()) != 0) fail("cannot be replaced");
  part_.clear();
}

}  // namespace voxeld::cli
