#include "server/store/store_mark.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <iterator>
#include <span>
#include <utility>

#include "proto/text/hex.h"
#include "server/base/check.h"
#include "server/base/random.h"

namespace voxeld {
namespace {

constexpr std::string_view kHead = "voxeld store 1\nid ";
constexpr std::string_view kNumberNames[] = {"\ngeneration ", "\nkept_ms ", "\nwall_ms "};
constexpr size_t kIdDigits = 32;
constexpr size_t kNumberDigits = 19;  // of the largest int64_t
constexpr size_t kMarkBytesMax = 256;

std::string padded(int64_t number) {
  std::string digits = std::to_string(number);
  return std::string(kNumberDigits - digits.size(), '0') + digits;
}

std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

}  // namespace

StoreMark new_store_mark() {
  StoreMark mark;
  mark.id = random_hex(kIdDigits);
  return mark;
}

std::string store_mark_text(const StoreMark& mark) {
  std::string text = std::string(kHead) + mark.id;
  const int64_t numbers[] = {mark.generation, mark.kept_ms, mark.wall_ms};
  for (size_t i = 0; i < std::size(kNumberNames); ++i) {
    text += std::string(kNumberNames[i]) + padded(numbers[i]);
  }
  return text + "\n";
}

Result<StoreMark> parse_store_mark(std::string_view text, const std::string& file) {
  StoreMark mark;
  size_t at = std::min(kHead.size(), text.size());
  mark.id = text.substr(at, kIdDigits);
  at += mark.id.size();
  int64_t* const numbers[] = {&mark.generation, &mark.kept_ms, &mark.wall_ms};
  for (size_t i = 0; i < std::size(kNumberNames); ++i) {
    at = std::min(at + kNumberNames[i].size(), text.size());
    const std::string_view digits = text.substr(at, kNumberDigits);
    std::from_chars(digits.data(), digits.data() + digits.size(), *numbers[i]);
    at += digits.size();
    *numbers[i] = std::max<int64_t>(0, *numbers[i]);
  }
  const bool has_id = mark.id.size() == kIdDigits && is_hex(mark.id);
  // Text is valid exactly if writing the mark again gives the same bytes.
  if (has_id && store_mark_text(mark) == text) return mark;
  return Error{ErrorCode::kInternal, file,
               "\"voxeld store 1\", an id of 32 hex digits, and generation, kept_ms and wall_ms of "
               "19 digits",
               std::to_string(text.size()) + " bytes"};
}

std::filesystem::path StoreMarkFile::path_in(const std::filesystem::path& data_dir) {
  return data_dir / "blobs" / "mark";
}

Result<std::unique_ptr<StoreMarkFile>> StoreMarkFile::open(const std::filesystem::path& path) {
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW));
  if (!fd.valid() && errno == ENOENT) return std::unique_ptr<StoreMarkFile>();
  if (!fd.valid()) return errno_error("open", path);
  std::array<char, kMarkBytesMax> text{};
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
  ::unlink(temporary.c_str());  // left by a process that was killed
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
  write();
}

void StoreMarkFile::note_clock(int64_t kept_ms, int64_t wall_ms) {
  const MutexLock lock(mutex_);
  mark_.kept_ms = kept_ms;
  mark_.wall_ms = wall_ms;
  write();
}

void StoreMarkFile::write() {
  const std::string text = store_mark_text(mark_);
  [[maybe_unused]] const ssize_t written = ::pwrite(fd_.get(), text.data(), text.size(), 0);
}

StoreMark StoreMarkFile::mark() const {
  const MutexLock lock(mutex_);
  return mark_;
}

}  // namespace voxeld
