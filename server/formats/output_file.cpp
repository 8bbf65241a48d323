#include "server/formats/output_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>

#include "server/base/disk/disk_reserve.h"

namespace voxeld {

Result<OutputFile> OutputFile::create(const std::filesystem::path& path) {
  UniqueFd file(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  if (!file.valid()) return errno_error("create", path);
  return OutputFile(std::move(file));
}

Status OutputFile::append(std::span<const uint8_t> bytes) {
  if (file_.valid()) {
    VOXELD_TRY(write_in_pieces(file_.get(), bytes));
  } else {
    memory_.insert(memory_.end(), bytes.begin(), bytes.end());
  }
  size_ += bytes.size();
  return {};
}

Status OutputFile::extend(uint64_t bytes) {
  if (file_.valid()) {
    VOXELD_TRY(reserve_room(file_.get(), static_cast<int64_t>(size_), static_cast<int64_t>(bytes)));
  }
  size_ += bytes;
  if (!file_.valid()) {
    memory_.resize(size_);
    return {};
  }
  if (::ftruncate(file_.get(), static_cast<off_t>(size_)) != 0) return errno_error("write", "file");
  if (::lseek(file_.get(), 0, SEEK_END) < 0) return errno_error("write", "file");
  return {};
}

Status OutputFile::replace(uint64_t offset, std::span<const uint8_t> bytes) {
  if (!file_.valid()) {
    std::ranges::copy(bytes, memory_.begin() + static_cast<ptrdiff_t>(offset));
    return {};
  }
  while (!bytes.empty()) {
    const ssize_t count =
        ::pwrite(file_.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno_error("write", "file");
    bytes = bytes.subspan(static_cast<size_t>(count));
    offset += static_cast<uint64_t>(count);
  }
  return {};
}

}  // namespace voxeld
