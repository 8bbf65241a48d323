// DIR/blobs/mark: which store the blobs belong to, and how far its database has come. The database
// holds the same id and a generation that is at least as high
// (server/jobs/retention/store_identity.h), or it is not the one that names these blobs.
//
//   voxeld store 1
//   id 9f86d081884c7d659a2feaa0c55ad015
//   generation 0000000000000000042
//   kept_ms 0000001763846400000
//   wall_ms 0000001763846400000
//
// The length is fixed: a new generation overwrites the old one in place, without a sync. So the
// file may fall behind its database when power fails, and is never ahead of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/base/disk/file.h"
#include "server/base/thread_annotations.h"

namespace voxeld {

struct StoreMark {
  std::string id;          // 32 lower-case hex digits
  int64_t generation = 0;  // commits of the database that changed rows
  // The clock of retention (server/jobs/retention/kept_clock.h), and the wall clock at that moment;
  // 0: new.
  int64_t kept_ms = 0, wall_ms = 0;
  bool operator==(const StoreMark&) const = default;
};

// A mark with a new id and generation 0.
StoreMark new_store_mark();
std::string store_mark_text(const StoreMark& mark);
// Parses a mark; `file` appears in errors. Errors: internal for any text that store_mark_text()
// does not produce.
Result<StoreMark> parse_store_mark(std::string_view text, const std::string& file);

// The mark file of a running daemon. Thread-safe.
class StoreMarkFile {
 public:
  static std::filesystem::path path_in(const std::filesystem::path& data_dir);
  // Returns null if there is none. Errors: those of parse_store_mark().
  static Result<std::unique_ptr<StoreMarkFile>> open(const std::filesystem::path& path);
  // Writes a file with `mark`, synced.
  static Result<std::unique_ptr<StoreMarkFile>> create(const std::filesystem::path& path,
                                                       StoreMark mark);
  // A lower generation changes nothing. A failed write is retried with the next generation.
  void raise_generation(int64_t generation) EXCLUDES(mutex_);
  void note_clock(int64_t kept_ms, int64_t wall_ms) EXCLUDES(mutex_);
  StoreMark mark() const EXCLUDES(mutex_);

 private:
  StoreMarkFile(UniqueFd fd, StoreMark mark) : fd_(std::move(fd)), mark_(std::move(mark)) {}
  void write() REQUIRES(mutex_);
  const UniqueFd fd_;
  mutable Mutex mutex_;
  StoreMark mark_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
