#include "server/base/disk/file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <iterator>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/disk/disk_reserve.h"

namespace voxeld {

void UniqueFd::reset(int fd) {
  if (fd_ >= 0) ::close(fd_);
  fd_ = fd;
}

Error errno_error(std::string_view action, const std::filesystem::path& path) {
  const int saved = errno;
  return code_error(action, path.filename(), {saved, std::generic_category()});
}

Error code_error(std::string_view action, const std::filesystem::path& path,
                 const std::error_code& code) {
  Error error;
  const bool is_full = code.value() == ENOSPC || code.value() == EDQUOT;
  error.code = is_full ? ErrorCode::kStorageFull : ErrorCode::kInternal;
  error.detail = std::string(action) + " " + path.string() + ": " + code.message();
  return error;
}

Result<MappedFile> MappedFile::open(const std::filesystem::path& path) {
  UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd.valid()) return errno_error("open", path);
  struct stat info {};
  if (::fstat(fd.get(), &info) != 0) return errno_error("stat", path);
  MappedFile file;
  file.size_ = static_cast<size_t>(info.st_size);
  if (file.size_ == 0) return file;
  void* data = ::mmap(nullptr, file.size_, PROT_READ, MAP_PRIVATE, fd.get(), 0);
  if (data == MAP_FAILED) {
    file.size_ = 0;
    return errno_error("map", path);
  }
  file.data_ = static_cast<const uint8_t*>(data);
  return file;
}

MappedFile::~MappedFile() {
  if (data_ != nullptr) ::munmap(const_cast<uint8_t*>(data_), size_);
}
MappedFile::MappedFile(MappedFile&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}
MappedFile& MappedFile::operator=(MappedFile&& other) noexcept {
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  return *this;
}

Result<std::vector<uint8_t>> read_file(const std::filesystem::path& path) {
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(path));
  return std::vector<uint8_t>(file.bytes().begin(), file.bytes().end());
}

Status write_all(int fd, std::span<const uint8_t> bytes) {
  VOXELD_TRY(reserve_room(fd, ::lseek(fd, 0, SEEK_CUR), std::ssize(bytes)));
  while (!bytes.empty()) {
    const ssize_t count = ::write(fd, bytes.data(), bytes.size());
    if (count < 0) {
      if (errno == EINTR) continue;
      return errno_error("write", "file");
    }
    bytes = bytes.subspan(static_cast<size_t>(count));
  }
  return {};
}

Status write_in_pieces(int fd, std::span<const uint8_t> bytes) {
  constexpr size_t kPieceBytes = size_t{4} << 20;
  while (!bytes.empty()) {
    cancel_point();
    const auto piece = bytes.first(std::min(bytes.size(), kPieceBytes));
    VOXELD_TRY(write_all(fd, piece));
    bytes = bytes.subspan(piece.size());
  }
  return {};
}

Status write_file(const std::filesystem::path& path, std::span<const uint8_t> bytes) {
  UniqueFd fd(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  if (!fd.valid()) return errno_error("create", path);
  return write_all(fd.get(), bytes);
}

Status sync_path(const std::filesystem::path& path) {
  UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd.valid()) return errno_error("open", path);
  if (::fsync(fd.get()) != 0) return errno_error("sync", path);
  return {};
}

}  // namespace voxeld
