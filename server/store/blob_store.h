// A store of content-addressed files: DIR/blobs/ab/sha256-ab…, written to DIR/tmp, synced, then
// renamed.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/result.h"
#include "server/base/file.h"
#include "server/base/sha256.h"
#include "server/base/thread_annotations.h"
#include "server/store/blob_checks.h"
#include "server/store/disk_room.h"
#include "server/store/quarantine.h"

namespace voxeld {

// Pins blobs that are stored but not yet named by the database. Thread-safe.
class BlobPins {
 public:
  // Keeps `id` from being removed until the returned pointer is destroyed.
  static std::shared_ptr<const void> pin(const std::shared_ptr<BlobPins>& pins, std::string id);
  // Calls `remove` unless the blob is pinned, and prevents pinning meanwhile. Returns false if it
  // is pinned.
  bool unless_pinned(std::string_view id, const std::function<void()>& remove) EXCLUDES(mutex_);
  // Ids to examine: those that were unpinned, and those passed to suspect().
  std::set<std::string> take_suspects() EXCLUDES(mutex_);
  void suspect(std::string id) EXCLUDES(mutex_);

 private:
  void unpin(std::string_view id) EXCLUDES(mutex_);
  Mutex mutex_;
  std::multiset<std::string, std::less<>> ids_ GUARDED_BY(mutex_);
  std::set<std::string> suspects_ GUARDED_BY(mutex_);
};

// The state that copies of a store share.
struct BlobState {
  BlobState(const std::filesystem::path& root, int64_t disk_reserve_bytes)
      : disk(root, disk_reserve_bytes) {}
  std::shared_ptr<BlobPins> pins = std::make_shared<BlobPins>();
  BlobChecks checks;
  std::atomic<int64_t> trashed{0};  // the next file name in the trash
  std::atomic<int64_t> bytes{0};    // over all blobs: see BlobStore::recount()
  DiskRoom disk;
};

// Facts about a blob. Hidden: whether finish() and adopt() found the same bytes already there. It
// would reveal other tenants' uploads.
struct BlobInfo {
  std::string id;  // "sha256-…"
  int64_t bytes = 0;
  // Set by finish() and adopt(): keeps the blob in the store while a copy of it lives.
  std::shared_ptr<const void> pin = nullptr;
};

// Receives one blob and hashes it. If it is destroyed without finish(), its file is removed.
class BlobWriter {
 public:
  ~BlobWriter();
  BlobWriter(BlobWriter&&) noexcept;
  BlobWriter& operator=(BlobWriter&&) noexcept = delete;
  // Errors: payload-too-large over the writer's limit, storage-full (also if the disk's reserve
  // would be touched), internal.
  Status append(std::span<const uint8_t> bytes);
  int64_t bytes() const { return bytes_; }
  // Syncs, renames and syncs the directory: on return the blob survives power loss. If the same
  // bytes were there already, the same work is done, so its time does not reveal that. The replaced
  // file goes to the trash.
  Result<BlobInfo> finish();

 private:
  friend class BlobStore;
  Status look_at_disk(int64_t more_bytes);
  BlobWriter(const std::filesystem::path& root, std::shared_ptr<BlobState> state, UniqueFd fd,
             std::filesystem::path temporary, int64_t bytes_max);
  std::filesystem::path root_;
  std::shared_ptr<BlobState> state_;
  UniqueFd fd_;
  std::filesystem::path temporary_;  // empty after finish()
  int64_t bytes_max_;
  int64_t bytes_ = 0;
  int64_t bytes_until_look_ = 0;  // until the next check of the disk
  bool broken_ = false;           // an append failed halfway: the file differs from the hashed
                                  // bytes
  Sha256 hash_;
};

// Thread-safe. Copies share their state: the directory and its pins.
class BlobStore {
 public:
  // Makes the directories and removes an earlier process's files in tmp. `disk_reserve_bytes`: as
  // in DiskRoom.
  static Result<BlobStore> open(const std::filesystem::path& root, int64_t disk_reserve_bytes = 0);

  Result<BlobWriter> begin(int64_t bytes_max) const;
  // Hashes, syncs and moves a finished file (a worker's output) into the store. Errors:
  // storage-full if less than the disk's reserve is free; the file already occupies its space.
  Result<BlobInfo> adopt(const std::filesystem::path& file) const;
  // Errors: not-found, also for text that is not an id.
  Result<BlobInfo> stat(std::string_view id) const;
  // Like stat(), for a blob that is about to be read. Its bytes are compared with its name once per
  // process, and again whenever the file was touched. Errors: not-found; gone if it is damaged.
  Result<BlobInfo> verified(std::string_view id) const;
  // Whether the blob exists and is not known to be damaged; reads nothing.
  bool is_usable(std::string_view id) const;
  // The path of a blob, to open it or to pass it to a worker. Check stat() first. Text that is not
  // an id gives a path inside the store at which nothing exists.
  std::filesystem::path path_of(std::string_view id) const;
  // Removes the blob at once, in a time independent of its size; empty_trash() frees its bytes.
  // Errors: not-found; conflict while the blob is pinned.
  Status remove(std::string_view id) const;
  // Unlinks removed and replaced files, in a time that grows with their size. Do not call it on a
  // thread that a client waits for: the time would reveal whether others have the same bytes.
  void empty_trash() const;
  // Moves the blob to the quarantine of the day instead. Errors: as remove(); storage-full.
  Status quarantine(std::string_view id, std::string_view day) const;
  // Moves a blob back from quarantine. If the store has it by now, the copy in quarantine is
  // removed.
  Status restore(const QuarantinedBlob& blob) const;
  Result<std::vector<std::string>> list() const;
  // Blobs that may no longer be needed, each once: those whose last pin was dropped since the last
  // call (an abandoned upload, or one that was pinned at its removal), and those passed to
  // suspect(). The owner of the database calls this now and then.
  std::set<std::string> take_suspects() const { return state_->pins->take_suspects(); }
  void suspect(std::string id) const { state_->pins->suspect(std::move(id)); }
  const std::filesystem::path& root() const { return root_; }
  DiskRoom& disk() const { return state_->disk; }
  // Bytes of all blobs, by the last recount() and the changes since; 0 before the first.
  int64_t bytes() const { return state_->bytes; }
  // Counts the bytes of every file.
  Status recount() const;
  // The number of blobs that verified() found damaged.
  int64_t damaged_count() const { return state_->checks.damaged_count(); }

 private:
  Status take_out(std::string_view id,
                  const std::function<Status(const std::filesystem::path&)>& move) const;
  BlobStore(std::filesystem::path root, int64_t disk_reserve_bytes)
      : root_(std::move(root)), state_(std::make_shared<BlobState>(root_, disk_reserve_bytes)) {}
  std::filesystem::path root_;
  std::shared_ptr<BlobState> state_;
};

}  // namespace voxeld
