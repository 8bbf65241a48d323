// Content-addressed files: DIR/blobs/ab/sha256-ab…, written to DIR/tmp, synced, then renamed.
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

// Blobs that were stored and that nothing in the database names yet. Thread-safe.
class BlobPins {
 public:
  // Until what comes back is destroyed, `id` is not removed.
  static std::shared_ptr<const void> pin(const std::shared_ptr<BlobPins>& pins, std::string id);
  // Calls `remove` unless the blob is pinned, and keeps it from being pinned meanwhile. False: it
  // is pinned.
  bool unless_pinned(std::string_view id, const std::function<void()>& remove) EXCLUDES(mutex_);
  // Ids to look at: those that nobody pins any more, and those that suspect() was told.
  std::set<std::string> take_suspects() EXCLUDES(mutex_);
  void suspect(std::string id) EXCLUDES(mutex_);

 private:
  void unpin(std::string_view id) EXCLUDES(mutex_);
  Mutex mutex_;
  std::multiset<std::string, std::less<>> ids_ GUARDED_BY(mutex_);
  std::set<std::string> suspects_ GUARDED_BY(mutex_);
};

// What copies of a store share.
struct BlobState {
  BlobState(const std::filesystem::path& root, int64_t disk_reserve_bytes)
      : disk(root, disk_reserve_bytes) {}
  std::shared_ptr<BlobPins> pins = std::make_shared<BlobPins>();
  BlobChecks checks;
  std::atomic<int64_t> trashed{0};  // names of files in the trash are numbers
  std::atomic<int64_t> bytes{0};    // of all blobs: see BlobStore::recount()
  DiskRoom disk;
};

// What finish() and adopt() do not tell: whether the same bytes were there already. Somebody else
// may have stored them, whom that is no business of.
struct BlobInfo {
  std::string id;  // "sha256-…"
  int64_t bytes = 0;
  // Of finish() and adopt(): keeps the blob in the store as long as a copy of this lives.
  std::shared_ptr<const void> pin = nullptr;
};

// Receives one blob while it is being hashed. Dropped without finish(), its file goes away.
class BlobWriter {
 public:
  ~BlobWriter();
  BlobWriter(BlobWriter&&) noexcept;
  BlobWriter& operator=(BlobWriter&&) noexcept = delete;
  // Errors: payload-too-large over the writer's cap, storage-full (also where it would eat into the
  // disk's reserve), internal.
  Status append(std::span<const uint8_t> bytes);
  int64_t bytes() const { return bytes_; }
  // Syncs, renames, syncs the directory: the blob survives power loss when this returns. The same
  // work is done where the same bytes were there already, so that its time does not tell; the file
  // that is replaced goes to the trash.
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
  int64_t bytes_until_look_ = 0;  // at the disk
  bool broken_ = false;           // an append failed halfway: the file is not what was hashed
  Sha256 hash_;
};

// Thread-safe. Copies share their state, which is the directory and what is pinned in it.
class BlobStore {
 public:
  // Makes the directories and removes what an earlier process left in tmp. `disk_reserve_bytes`: as
  // of DiskRoom.
  static Result<BlobStore> open(const std::filesystem::path& root, int64_t disk_reserve_bytes = 0);

  Result<BlobWriter> begin(int64_t bytes_max) const;
  // Hashes, syncs and moves a finished file (a worker's output) into the store. Errors:
  // storage-full where less than the disk's reserve is free, which the file is part of.
  Result<BlobInfo> adopt(const std::filesystem::path& file) const;
  // Errors: not-found; also for text that is not an id.
  Result<BlobInfo> stat(std::string_view id) const;
  // The same for a blob that is about to be read: its bytes are compared with its name, once per
  // process and whenever the file was touched since. Errors: not-found; gone when it is damaged.
  Result<BlobInfo> verified(std::string_view id) const;
  // Whether it is there and not known to be damaged; reads nothing.
  bool is_usable(std::string_view id) const;
  // Where a blob is; for passing to a worker or opening. Check stat() first. Text that is not an id
  // gives the path of nothing, inside the store.
  std::filesystem::path path_of(std::string_view id) const;
  // Takes it out of the store at once, in the same time whatever its size; empty_trash() frees its
  // bytes. Errors: not-found; conflict while the blob is pinned.
  Status remove(std::string_view id) const;
  // Unlinks what was removed or replaced, which takes as long as the files are large: not for a
  // thread that somebody waits for, who could tell by it that nobody else has the same bytes.
  void empty_trash() const;
  // Moves it to the quarantine of the day instead. Errors: as remove(); storage-full.
  Status quarantine(std::string_view id, std::string_view day) const;
  // Moves a blob back from there; where the store has it by now, the copy in quarantine goes.
  Status restore(const QuarantinedBlob& blob) const;
  Result<std::vector<std::string>> list() const;
  // Blobs that perhaps nothing needs any more, each once: those whose last pin was dropped since
  // the last call (an upload that came to nothing, one that could not be removed while it was
  // pinned), and those that suspect() was told. Whoever knows what is needed asks now and then.
  std::set<std::string> take_suspects() const { return state_->pins->take_suspects(); }
  void suspect(std::string id) const { state_->pins->suspect(std::move(id)); }
  const std::filesystem::path& root() const { return root_; }
  DiskRoom& disk() const { return state_->disk; }
  // Of all blobs, as of the last recount() and what came and went since; 0 before the first.
  int64_t bytes() const { return state_->bytes; }
  // Looks at every file.
  Status recount() const;
  // How many blobs verified() found damaged.
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
