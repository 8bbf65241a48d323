// The free space of the disk, and the work that it still permits.
//
//   free bytes               uploads, outputs of jobs   new jobs   deletes, evictions, ends of jobs
//   reserve and kJobRoom     yes                        yes        yes
//   reserve or more          yes                        refused    yes
//   less                     storage-full               refused    yes
//   less than the ballast    storage-full               refused    the ballast is freed for them
//
// Room is taken before it is written: by the gateway with Room, by workers as
// server/base/disk/disk_reserve.h says. Readiness is what a new job would get.
//
// Once the ballast is freed, data and jobs are refused until there is room to allocate it again:
// what they took instead could be all that deletes had.
#pragma once

#include <cstdint>
#include <filesystem>
#include <utility>

#include "proto/result.h"
#include "server/base/thread_annotations.h"

namespace voxeld {

// Thread-safe.
class DiskRoom {
 public:
  // The ballast covers deletes: each writes some ten pages to the database's log, which restarts
  // after 4 MB.
  static constexpr int64_t kBallastBytesMax = int64_t{16} << 20;
  // Parts of the disk's size, because on a small disk reserve and ballast would be most of it.
  static constexpr int64_t kReservePartOfDisk = 20, kBallastPartOfDisk = 32;
  // Free beside the reserve for a job to be accepted: room for rows and for a small output.
  static constexpr int64_t kJobRoomBytes = int64_t{1} << 20;
  // The part of it that workers leave.
  static constexpr int64_t kRowRoomBytes = int64_t{1} << 18;
  // Bytes that the rows of one tenant's jobs may take: some ten thousand jobs.
  static constexpr int64_t kRecordBytesMax = int64_t{64} << 20, kRecordPartOfDisk = 16;

  // `reserve_bytes_max`: on the disk of `data_dir`; 0: no reserve.
  DiskRoom(std::filesystem::path data_dir, int64_t reserve_bytes_max)
      : data_dir_(std::move(data_dir)), reserve_bytes_max_(reserve_bytes_max) {}

  // Free bytes of the file system, its size, and the free bytes below which data is refused.
  Result<int64_t> free_bytes() const;
  Result<int64_t> total_bytes() const;
  Result<int64_t> reserve_bytes() const;
  // Bytes that the rows of one tenant's jobs may take of this disk (TenantUsage::record_bytes).
  Result<int64_t> record_bytes_max() const;

  // Whether data of clients and workers may be stored. Errors: storage-full.
  Status for_data() EXCLUDES(mutex_);
  // Whether a job may be accepted: its output has to fit as well. Errors: storage-full.
  Status for_jobs() EXCLUDES(mutex_);

  // Bytes that the caller is about to write. Others do not get them while it lives.
  class Room {
   public:
    ~Room() {
      if (disk_ != nullptr) disk_->give_back(bytes_);
    }
    Room(Room&& other) noexcept
        : disk_(std::exchange(other.disk_, nullptr)), bytes_(other.bytes_) {}
    Room& operator=(Room&&) = delete;

   private:
    friend class DiskRoom;
    Room(DiskRoom& disk, int64_t bytes) : disk_(&disk), bytes_(bytes) {}
    DiskRoom* disk_;
    int64_t bytes_;
  };
  // Errors: storage-full where less than the reserve would stay free.
  Result<Room> take(int64_t bytes) EXCLUDES(mutex_);
  // Free bytes that workers leave: more than the reserve, so that an output whose room they took is
  // not refused for the rows that were written meanwhile.
  Result<int64_t> worker_reserve_bytes() const;
  // Whether so little is left that workers must stop writing.
  bool is_nearly_full() const;

  // Frees the ballast if little else is free, because the caller is about to write and thereby free
  // more. Returns whether so little was free.
  bool make_way() EXCLUDES(mutex_);
  // Allocates DIR/ballast if it is missing and there is room. Call it now and then.
  void keep_ballast() EXCLUDES(mutex_);

 private:
  Result<int64_t> ballast_bytes() const;
  // A freed ballast is allocated first, and where it cannot be, its room is part of `bytes_min`.
  Status check_with_ballast(int64_t bytes_min, const char* refused) EXCLUDES(mutex_);
  Status check(int64_t bytes_min, const char* refused) const;
  void give_back(int64_t bytes) EXCLUDES(mutex_);
  std::filesystem::path ballast_path() const { return data_dir_ / "ballast"; }

  const std::filesystem::path data_dir_;
  const int64_t reserve_bytes_max_;
  Mutex mutex_;
  bool was_freed_ GUARDED_BY(mutex_) = false;  // and could not be allocated again yet
  int64_t taken_ GUARDED_BY(mutex_) = 0;       // bytes of all rooms
};

}  // namespace voxeld
