#include "server/store/blob_store.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <string>
#include <system_error>
#include <utility>

#include "proto/text/hex.h"
#include "server/base/check.h"
#include "server/base/disk/directory.h"
#include "server/base/disk/file.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kBlobs = "blobs";
constexpr std::string_view kTemporary = "tmp";
constexpr std::string_view kTrash = "trash";
constexpr size_t kPrefixBytes = std::string_view("sha256-").size();
constexpr size_t kFanOutDigits = 2;  // 256 folders keep each below some ten thousand entries

Error not_found(std::string_view id) {
  return {ErrorCode::kNotFound, "no such blob",
          "sha256- and 64 lower-case hex digits of a stored blob", std::string(id.substr(0, 80))};
}

fs::path blob_path(const fs::path& root, std::string_view id) {
  if (!is_sha256_id(id)) return root / kBlobs / "no-such-blob";
  return root / kBlobs / id.substr(kPrefixBytes, kFanOutDigits) / id;
}

// Makes a new file in tmp with a unique name.
Result<std::pair<UniqueFd, fs::path>> make_temporary(const fs::path& root) {
  std::string name = (root / kTemporary / "blob-XXXXXX").native();
  UniqueFd fd(::mkostemp(name.data(), O_CLOEXEC));
  if (!fd.valid()) return errno_error("create", name);
  return std::pair<UniqueFd, fs::path>(std::move(fd), fs::path(name));
}

// Empties the folder. Files that cannot be removed only waste space.
Status empty_folder(const fs::path& folder) {
  VOXELD_ASSIGN(const auto names, directory_names(folder));
  for (const std::string& name : names) {
    if (::unlink((folder / name).c_str()) != 0) remove_tree(folder / name);
  }
  return {};
}

// Makes the 256 folders of blobs in advance, so the first blob of a folder does not take longer.
Status make_fan_out(const fs::path& blobs) {
  for (const char high : kHexDigits) {
    for (const char low : kHexDigits) {
      const fs::path folder = blobs / std::string{high, low};
      if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) {
        return errno_error("create directory", folder);
      }
    }
  }
  return sync_path(blobs);
}

fs::path trash_path(const fs::path& root, BlobState& state) {
  return root / kTrash / std::to_string(++state.trashed);
}

// Whether the file of a blob is there, as far as is known without reading it.
bool seems_whole(BlobState& state, const fs::path& file, const std::string& id, int64_t bytes) {
  const auto stamp = stamp_of(file);
  return stamp && stamp->bytes == bytes && state.checks.known(id, *stamp).value_or(true);
}

// Moves a file to its place, synced if `durability` is kNow. An existing file with the same bytes
// is replaced; its readers keep reading the old one. A file that is not synced does not replace one
// that may be: it goes to the trash instead, by as many calls.
Result<BlobInfo> place(const fs::path& root, BlobState& state, const fs::path& file,
                       const std::string& id, int64_t bytes, Durability durability) {
  const fs::path target = blob_path(root, id);
  BlobInfo info{id, bytes, BlobPins::pin(state.pins, id)};
  bool stays = false;
  {
    const MutexLock placing(state.placing);
    struct stat replaced {};
    const bool is_new = ::stat(target.c_str(), &replaced) != 0;
    stays = durability == Durability::kSoon && seems_whole(state, target, id, bytes);
    // Links the old file into the trash; otherwise the rename would free its bytes here, which
    // takes time. A failure is ignored: on file systems without links, the rename does free them.
    [[maybe_unused]] const int linked = ::link(target.c_str(), trash_path(root, state).c_str());
    const fs::path place = stays ? trash_path(root, state) : target;
    if (::rename(file.c_str(), place.c_str()) != 0) {
      return errno_error("move into the store", file);
    }
    if (!stays) state.bytes += bytes - (is_new ? 0 : static_cast<int64_t>(replaced.st_size));
  }
  if (durability == Durability::kNow) {
    VOXELD_TRY(sync_path(target.parent_path()));
  } else {
    state.unsynced.add(id);
  }
  if (!stays) state.checks.note_intact(id, target);
  return info;
}

// A file in tmp until it is finished.
class FileSink final : public BlobSink {
 public:
  FileSink(fs::path root, std::shared_ptr<BlobState> state, Durability durability, UniqueFd fd,
           fs::path temporary)
      : root_(std::move(root)),
        state_(std::move(state)),
        durability_(durability),
        fd_(std::move(fd)),
        temporary_(std::move(temporary)) {}
  FileSink(const FileSink&) = delete;
  FileSink& operator=(const FileSink&) = delete;
  ~FileSink() override {
    if (!temporary_.empty()) ::unlink(temporary_.c_str());
  }

  Status write(std::span<const uint8_t> bytes) override {
    VOXELD_ASSIGN(const DiskRoom::Room room, state_->disk.take(std::ssize(bytes)));
    return write_all(fd_.get(), bytes);
  }

  Result<BlobInfo> finish(std::string id, int64_t bytes) override {
    if (durability_ == Durability::kNow && ::fsync(fd_.get()) != 0) {
      return errno_error("sync", temporary_);
    }
    fd_.reset();
    VOXELD_ASSIGN(BlobInfo info, place(root_, *state_, temporary_, id, bytes, durability_));
    temporary_.clear();
    return info;
  }

 private:
  const fs::path root_;
  const std::shared_ptr<BlobState> state_;
  const Durability durability_;
  UniqueFd fd_;
  fs::path temporary_;  // empty after finish()
};

class FileReader final : public BlobReader {
 public:
  FileReader(UniqueFd fd, std::string id, int64_t offset, int64_t bytes)
      : fd_(std::move(fd)), id_(std::move(id)), at_(offset), left_(bytes) {}

  Result<size_t> read(std::span<uint8_t> into) override {
    const auto wanted = static_cast<size_t>(std::min<int64_t>(left_, std::ssize(into)));
    size_t count = 0;
    while (count < wanted) {
      const ssize_t got = ::pread(fd_.get(), into.data() + count, wanted - count, at_);
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) return errno_error("read", id_);
      if (got == 0) {
        return Error{ErrorCode::kGone, "the stored bytes of " + id_ + " end too early",
                     std::to_string(left_) + " more bytes", "0"};
      }
      count += static_cast<size_t>(got);
      at_ += got;
      left_ -= got;
    }
    return count;
  }

 private:
  const UniqueFd fd_;
  const std::string id_;
  int64_t at_, left_;
};

}  // namespace

void UnsyncedBlobs::add(std::string id) {
  const MutexLock lock(mutex_);
  ids_.insert(std::move(id));
}

Status UnsyncedBlobs::sync(const std::function<Status(const std::string& id)>& sync_one) {
  const MutexLock syncing(syncing_);
  std::set<std::string> ids;
  {
    const MutexLock lock(mutex_);
    ids.swap(ids_);
  }
  while (!ids.empty()) {
    if (Status synced = sync_one(*ids.begin()); !synced) {
      const MutexLock lock(mutex_);
      ids_.merge(ids);
      return synced;
    }
    ids.erase(ids.begin());
  }
  return {};
}

std::shared_ptr<const void> BlobPins::pin(const std::shared_ptr<BlobPins>& pins, std::string id) {
  {
    const MutexLock lock(pins->mutex_);
    pins->ids_.insert(id);
  }
  // The pointer's only effect is to unpin the id when the last copy is destroyed.
  return {pins.get(), [pins, id = std::move(id)](const void*) { pins->unpin(id); }};
}

// Allocates nothing, because memory may have run out.
void BlobPins::unpin(std::string_view id) {
  const MutexLock lock(mutex_);
  auto pinned = ids_.extract(ids_.find(id));
  if (!ids_.contains(id)) suspects_.insert(std::move(pinned));
}

std::set<std::string> BlobPins::take_suspects() {
  const MutexLock lock(mutex_);
  return std::exchange(suspects_, {});
}

void BlobPins::suspect(std::string id) {
  const MutexLock lock(mutex_);
  suspects_.insert(std::move(id));
}

bool BlobPins::unless_pinned(std::string_view id, const std::function<void()>& remove) {
  const MutexLock lock(mutex_);
  if (ids_.contains(id)) return false;
  remove();
  return true;
}

void BlobStore::empty_trash() {
  [[maybe_unused]] const Status emptied = empty_folder(root_ / kTrash);  // a failure is retried
                                                                         // next time
}

Result<BlobStore> BlobStore::open(const fs::path& root, int64_t disk_reserve_bytes) {
  std::error_code failed;
  fs::create_directories(root, failed);
  if (failed) return code_error("cannot create the data directory", root, failed);
  VOXELD_TRY(make_directory(root / kBlobs));
  VOXELD_TRY(make_fan_out(root / kBlobs));
  for (const std::string_view folder : {kTemporary, kTrash}) {
    VOXELD_TRY(make_directory(root / folder));
    VOXELD_TRY(empty_folder(root / folder));
  }
  return BlobStore(root, disk_reserve_bytes);
}

Result<BlobWriter> BlobStore::begin(int64_t bytes_max, Durability durability) {
  VOXELD_ASSIGN(auto temporary, make_temporary(root_));
  return BlobWriter(
      std::make_unique<FileSink>(root_, state_, durability, std::move(temporary.first),
                                 std::move(temporary.second)),
      bytes_max);
}

Status BlobStore::sync() {
  return state_->unsynced.sync([this](const std::string& id) -> Status {
    const fs::path path = blob_path(root_, id);
    UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (!fd.valid()) return errno == ENOENT ? Status() : errno_error("open", path);  // removed
    if (::fsync(fd.get()) != 0) return errno_error("sync", path);
    return sync_path(path.parent_path());
  });
}

Result<BlobInfo> BlobStore::adopt(const fs::path& file, Durability durability) {
  // O_NOFOLLOW: a worker must not make the store adopt another user's file through a link.
  UniqueFd fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  if (!fd.valid()) return errno_error("open", file);
  struct stat info {};
  if (::fstat(fd.get(), &info) != 0) return errno_error("stat", file);
  if (!S_ISREG(info.st_mode)) {
    return Error{ErrorCode::kInternal, file.filename().string() + " is not a regular file", "", ""};
  }
  VOXELD_TRY(state_->disk.for_data());
  VOXELD_ASSIGN(auto hashed, hash_file(fd.get(), file));
  if (durability == Durability::kNow && ::fsync(fd.get()) != 0) return errno_error("sync", file);
  return place(root_, *state_, file, hashed.first, hashed.second, durability);
}

Result<BlobInfo> BlobStore::stat(std::string_view id) const {
  if (!is_sha256_id(id)) return not_found(id);
  const fs::path path = blob_path(root_, id);
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) {
    if (errno == ENOENT) return not_found(id);
    return errno_error("stat", path);
  }
  return BlobInfo{std::string(id), static_cast<int64_t>(info.st_size)};
}

Result<BlobInfo> BlobStore::verified(std::string_view id) const {
  if (!is_sha256_id(id)) return not_found(id);
  BlobInfo info{std::string(id), 0};
  VOXELD_ASSIGN(const auto found, state_->checks.check(info.id, blob_path(root_, id)));
  info.bytes = found.stamp.bytes;
  if (found.is_intact) return info;
  return Error{ErrorCode::kGone, "the stored bytes of " + info.id + " were damaged on disk", "",
               ""};
}

bool BlobStore::is_usable(std::string_view id) const {
  if (!is_sha256_id(id)) return false;
  const auto stamp = stamp_of(blob_path(root_, id));
  return stamp && state_->checks.known(std::string(id), *stamp).value_or(true);
}

Result<std::unique_ptr<BlobReader>> BlobStore::read(std::string_view id, int64_t offset,
                                                    int64_t bytes) const {
  if (!is_sha256_id(id)) return not_found(id);
  const fs::path path = blob_path(root_, id);
  UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd.valid()) return errno == ENOENT ? not_found(id) : errno_error("open", path);
  struct stat info {};
  if (::fstat(fd.get(), &info) != 0) return errno_error("stat", path);
  const auto size = static_cast<int64_t>(info.st_size);
  if (offset < 0 || bytes < 0 || offset > size || bytes > size - offset) {
    return Error{ErrorCode::kBadRequest, "range of " + std::string(id),
                 "inside its " + std::to_string(size) + " bytes",
                 std::to_string(bytes) + " bytes at " + std::to_string(offset)};
  }
  return std::unique_ptr<BlobReader>(
      std::make_unique<FileReader>(std::move(fd), std::string(id), offset, bytes));
}

Result<fs::path> BlobStore::local_file(std::string_view id) const {
  VOXELD_TRY(stat(id));
  return path_of(id);
}

fs::path BlobStore::path_of(std::string_view id) const {
  return blob_path(root_, id);
}

// Removes a blob's file by `move`, unless the blob is pinned.
Status BlobStore::take_out(std::string_view id,
                           const std::function<Status(const fs::path&)>& move) {
  if (!is_sha256_id(id)) return not_found(id);
  const fs::path path = blob_path(root_, id);
  Status moved;
  const bool is_free = state_->pins->unless_pinned(id, [&] {
    struct stat info {};
    if (::stat(path.c_str(), &info) != 0) {
      moved = errno == ENOENT ? not_found(id) : errno_error("stat", path);
      return;
    }
    moved = move(path);
    if (moved) state_->bytes -= static_cast<int64_t>(info.st_size);
  });
  if (is_free) return moved;
  return Error{ErrorCode::kConflict, "blob " + std::string(id) + " is being registered", "", ""};
}

Status BlobStore::remove(std::string_view id) {
  return take_out(id, [this](const fs::path& path) {
    const fs::path trashed = trash_path(root_, *state_);
    return ::rename(path.c_str(), trashed.c_str()) == 0 ? Status() : errno_error("remove", path);
  });
}

Status BlobStore::quarantine(std::string_view id, std::string_view day) {
  return take_out(id, [&](const fs::path& path) { return Quarantine(root_).take(path, day); });
}

Status BlobStore::restore(const QuarantinedBlob& blob) {
  const fs::path target = blob_path(root_, blob.id);
  struct stat info {};
  if (::stat(blob.path.c_str(), &info) != 0) return errno_error("stat", blob.path);
  // link() instead of rename(): a blob uploaded meanwhile is not replaced.
  if (::link(blob.path.c_str(), target.c_str()) == 0) {
    state_->bytes += static_cast<int64_t>(info.st_size);
    VOXELD_TRY(sync_path(target.parent_path()));
  } else if (errno != EEXIST && ::access(target.c_str(), F_OK) != 0) {  // links are not known here
    if (::rename(blob.path.c_str(), target.c_str()) != 0) {
      return errno_error("move back into the store", blob.path);
    }
    state_->bytes += static_cast<int64_t>(info.st_size);
    return sync_path(target.parent_path());
  }
  if (::unlink(blob.path.c_str()) != 0) return errno_error("remove", blob.path);
  return {};
}

Result<std::vector<std::string>> BlobStore::list() const {
  std::vector<std::string> ids;
  VOXELD_ASSIGN(const auto folders, directory_names(root_ / kBlobs));
  for (const std::string& folder : folders) {
    if (folder.size() != kFanOutDigits) continue;  // the store's mark
    VOXELD_ASSIGN(auto names, directory_names(root_ / kBlobs / folder));
    for (std::string& name : names) {
      if (is_sha256_id(name)) ids.push_back(std::move(name));
    }
  }
  std::sort(ids.begin(), ids.end());
  return ids;
}

Status BlobStore::recount() {
  VOXELD_ASSIGN(const auto ids, list());
  const int64_t before = state_->bytes;
  int64_t total = 0;
  for (const std::string& id : ids) {
    if (const auto info = stat(id)) total += info->bytes;  // otherwise it was removed meanwhile
  }
  state_->bytes += total - before;
  return {};
}

}  // namespace voxeld
