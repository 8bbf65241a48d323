// The embedded ObjectStore: files DIR/blobs/ab/sha256-ab…, written to DIR/tmp, synced, then
// renamed.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/result.h"
#include "server/base/thread_annotations.h"
#include "server/store/blob_checks.h"
#include "server/store/disk_room.h"
#include "server/store/object_store.h"
#include "server/store/quarantine.h"

namespace voxeld {

// Blobs whose files are not synced yet. Thread-safe.
class UnsyncedBlobs {
 public:
  void add(std::string id) EXCLUDES(mutex_);
  // Calls sync_one(id) for each, and forgets it if that succeeds; stops at the first error. Blobs
  // that are added meanwhile wait for the next call; a second caller waits for the first one.
  Status sync(const std::function<Status(const std::string& id)>& sync_one)
      EXCLUDES(mutex_, syncing_);

 private:
  Mutex syncing_;  // taken before the other one
  Mutex mutex_;
  std::set<std::string> ids_ GUARDED_BY(mutex_);
};

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
  UnsyncedBlobs unsynced;
  std::atomic<int64_t> trashed{0};  // the next file name in the trash
  std::atomic<int64_t> bytes{0};    // over all blobs: see BlobStore::recount()
  DiskRoom disk;
  Mutex placing;  // one file at a time comes to its place, or new bytes are counted twice
};

// Thread-safe. Copies share their state: the directory and its pins.
class BlobStore final : public ObjectStore {
 public:
  // Makes the directories and removes an earlier process's files in tmp. `disk_reserve_bytes`: as
  // in DiskRoom.
  static Result<BlobStore> open(const std::filesystem::path& root, int64_t disk_reserve_bytes = 0);

  // The replaced file of equal bytes goes to the trash.
  using ObjectStore::adopt;
  using ObjectStore::begin;
  Result<BlobWriter> begin(int64_t bytes_max, Durability durability) override;
  Result<BlobInfo> adopt(const std::filesystem::path& file, Durability durability) override;
  Status sync() override;
  Result<BlobInfo> stat(std::string_view id) const override;
  // Compares the bytes once per process, and again whenever the file was touched.
  Result<BlobInfo> verified(std::string_view id) const override;
  bool is_usable(std::string_view id) const override;
  Result<std::unique_ptr<BlobReader>> read(std::string_view id, int64_t offset,
                                           int64_t bytes) const override;
  Result<std::filesystem::path> local_file(std::string_view id) const override;
  Result<std::vector<std::string>> list() const override;
  // empty_trash() frees its bytes.
  Status remove(std::string_view id) override;
  std::set<std::string> take_suspects() override { return state_->pins->take_suspects(); }
  void suspect(std::string id) override { state_->pins->suspect(std::move(id)); }

  // Unlinks removed and replaced files, in a time that grows with their size. Do not call it on a
  // thread that a client waits for: the time would reveal whether others have the same bytes.
  void empty_trash();
  // Moves the blob to the quarantine of the day instead. Errors: as remove(); storage-full.
  Status quarantine(std::string_view id, std::string_view day);
  // Moves a blob back from quarantine. If the store has it by now, the copy in quarantine is
  // removed.
  Status restore(const QuarantinedBlob& blob);
  // The path of the blob's file, whether or not it exists. Text that is not an id gives a path
  // inside the store at which nothing exists.
  std::filesystem::path path_of(std::string_view id) const;
  const std::filesystem::path& root() const { return root_; }
  DiskRoom& disk() const { return state_->disk; }
  // Bytes of all blobs, by the last recount() and the changes since; 0 before the first.
  int64_t bytes() const { return state_->bytes; }
  // Counts the bytes of every file.
  Status recount();
  // The number of blobs that verified() found damaged.
  int64_t damaged_count() const { return state_->checks.damaged_count(); }

 private:
  Status take_out(std::string_view id,
                  const std::function<Status(const std::filesystem::path&)>& move);
  BlobStore(std::filesystem::path root, int64_t disk_reserve_bytes)
      : root_(std::move(root)), state_(std::make_shared<BlobState>(root_, disk_reserve_bytes)) {}
  std::filesystem::path root_;
  std::shared_ptr<BlobState> state_;
};

}  // namespace voxeld
