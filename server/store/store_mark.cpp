#include "server/store/store_mark.h"

#include <fcntl.h>
#include <sys/random.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <span>
#include <utility>

#include "server/base/check.h"

namespace voxeld {
namespace {

constexpr std::string_view kHead = "voxeld store 1\nid ";
constexpr std::string_view kGeneration = "\ngeneration ";
constexpr std::string_view kHexDigits = "0123456789abcdef";
constexpr size_t kIdDigits = 32;
constexpr size_t kNumberDigits = 19;  // of the largest int64_t
constexpr size_t kNumberAt = kHead.size() + kIdDigits + kGeneration.size();
constexpr size_t kMarkBytes = kNumberAt + kNumberDigits + 1;

std::string padded(int64_t number) {
  std::string digits = std::to_string(number);
  return std::string(kNumberDigits - digits.size(), '0') + digits;
}

std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

}  // namespace

StoreMark new_store_mark() {
  std::array<uint8_t, kIdDigits / 2> bytes{};
  VOXELD_CHECK(::getrandom(bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size()),
               "getrandom");
  StoreMark mark;
  for (const uint8_t byte : bytes) {
    mark.id += kHexDigits[byte >> 4];
    mark.id += kHexDigits[byte & 15];
  }
  return mark;
}

std::string store_mark_text(const StoreMark& mark) {
  return std::string(kHead) + mark.id + std::string(kGeneration) + padded(mark.generation) + "\n";
}

Result<StoreMark> parse_store_mark(std::string_view text, const std::string& file) {
  StoreMark mark;
  if (text.size() == kMarkBytes) {
    mark.id = text.substr(kHead.size(), kIdDigits);
    const char* number = text.data() + kNumberAt;
    std::from_chars(number, number + kNumberDigits, mark.generation);
  }
  const bool has_id = mark.id.find_first_not_of(kHexDigits) == std::string::npos;
  if (has_id && mark.generation >= 0 && store_mark_text(mark) == text) return mark;
  return Error{ErrorCode::kInternal, file,
               "\"voxeld store 1\", an id of 32 hex digits and a generation of 19 digits",
               std::to_string(text.size()) + " bytes"};
}

std::filesystem::path StoreMarkFile::path_in(const std::filesystem::path& data_dir) {
  return data_dir / "blobs" / "mark";
}

Result<std::unique_ptr<StoreMarkFile>> StoreMarkFile::open(const std::filesystem::path& path) {
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW));
  if (!fd.valid() && errno == ENOENT) return std::unique_ptr<StoreMarkFile>();
  if (!fd.valid()) return errno_error("open", path);
  std::array<char, kMarkBytes + 1> text{};  // one more than there should be
  const ssize_t count = ::pread(fd.get(), text.data(), text.size(), 0);
  if (count < 0) return errno_error("read", path);
  VOXELD_ASSIGN(StoreMark mark,
                parse_store_mark({text.data(), static_cast<size_t>(count)}, path.string()));
  return std::unique_ptr<StoreMarkFile>(new StoreMarkFile(std::move(fd), std::move(mark)));
}

Result<std::unique_ptr<StoreMarkFile>> StoreMarkFile::create(const std::filesystem::path& path,
                                                             StoreMark mark) {
  std::filesystem::path temporary = path;
  temporary += ".new";
  ::unlink(temporary.c_str());  // of a process that was killed
  UniqueFd fd(::open(temporary.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (!fd.valid()) return errno_error("create", temporary);
  VOXELD_TRY(write_all(fd.get(), bytes_of(store_mark_text(mark))));
  if (::fsync(fd.get()) != 0) return errno_error("sync", temporary);
  if (::rename(temporary.c_str(), path.c_str()) != 0) return errno_error("replace", path);
  VOXELD_TRY(sync_path(path.parent_path()));
  return std::unique_ptr<StoreMarkFile>(new StoreMarkFile(std::move(fd), std::move(mark)));
}

void StoreMarkFile::raise_generation(int64_t generation) {
  const MutexLock lock(mutex_);
  if (generation <= mark_.generation) return;
  mark_.generation = generation;
  const std::string text = store_mark_text(mark_);
  [[maybe_unused]] const ssize_t written = ::pwrite(fd_.get(), text.data(), text.size(), 0);
}

StoreMark StoreMarkFile::mark() const {
  const MutexLock lock(mutex_);
  return mark_;
}

}  // namespace voxeld
