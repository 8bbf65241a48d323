// Inputs and outputs of jobs as blobs under the hash of their bytes, wherever they are kept.
// BlobStore keeps them as files of this machine.
// tests/unit/store/object_store_conformance_test.cpp is the contract of every implementation.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/result.h"
#include "server/base/durability.h"
#include "server/base/sha256.h"

namespace voxeld {

// Facts about a blob. Hidden: whether finish() and adopt() found the same bytes already there. It
// would reveal other tenants' uploads.
struct BlobInfo {
  std::string id;  // "sha256-…"
  int64_t bytes = 0;
  // Set by finish() and adopt(): keeps the blob in the store while a copy of it lives.
  std::shared_ptr<const void> pin = nullptr;
};

// The place at which a store receives one blob. Nothing stays of it if it is destroyed before
// finish().
class BlobSink {
 public:
  virtual ~BlobSink() = default;
  // Errors: storage-full, internal.
  virtual Status write(std::span<const uint8_t> bytes) = 0;
  // On return the blob is pinned, and as durable as begin() was told.
  virtual Result<BlobInfo> finish(std::string id, int64_t bytes) = 0;
};

// Receives one blob and hashes it, for any store. If it is destroyed without finish(), nothing is
// stored.
class BlobWriter {
 public:
  BlobWriter(std::unique_ptr<BlobSink> sink, int64_t bytes_max)
      : sink_(std::move(sink)), bytes_max_(bytes_max) {}
  // Errors: payload-too-large over `bytes_max`, storage-full (also if the disk's reserve would be
  // touched), internal.
  Status append(std::span<const uint8_t> bytes);
  int64_t bytes() const { return bytes_; }
  // The blob is as durable as ObjectStore::begin() was told. If the same bytes were there already,
  // the same work is done, so its time does not reveal that.
  Result<BlobInfo> finish();

 private:
  std::unique_ptr<BlobSink> sink_;  // null after finish()
  int64_t bytes_max_;
  int64_t bytes_ = 0;
  bool is_broken_ = false;  // an append failed halfway: what is stored differs from what is hashed
  Sha256 hash_;
};

// A range of a blob as a stream.
class BlobReader {
 public:
  virtual ~BlobReader() = default;
  // Fills `into` from its front and returns how many bytes: fewer than its size only at the end of
  // the range. Errors: gone if the blob is shorter than it was, internal.
  virtual Result<size_t> read(std::span<uint8_t> into) = 0;
};

// Thread-safe.
class ObjectStore {
 public:
  virtual ~ObjectStore() = default;

  // A blob that is stored kSoon and lost with the power is not there, or damaged: verified() tells.
  virtual Result<BlobWriter> begin(int64_t bytes_max, Durability durability) = 0;
  Result<BlobWriter> begin(int64_t bytes_max) { return begin(bytes_max, Durability::kNow); }
  // Hashes a finished file of this machine (a worker's output) and moves it into the store. Errors:
  // storage-full, also if less than the disk's reserve is free; internal if it is not a plain file.
  virtual Result<BlobInfo> adopt(const std::filesystem::path& file, Durability durability) = 0;
  Result<BlobInfo> adopt(const std::filesystem::path& file) {
    return adopt(file, Durability::kNow);
  }
  // Makes all blobs durable that are stored by now.
  virtual Status sync() = 0;
  // Errors: not-found, also for text that is not an id.
  virtual Result<BlobInfo> stat(std::string_view id) const = 0;
  // Like stat(), for a blob that is about to be read: its bytes have been compared with its name.
  // Errors: not-found; gone if it is damaged.
  virtual Result<BlobInfo> verified(std::string_view id) const = 0;
  // Whether the blob exists and is not known to be damaged; reads nothing.
  virtual bool is_usable(std::string_view id) const = 0;
  // The bytes [offset, offset + bytes) of a blob. An open reader reads to the end, also when the
  // blob is removed meanwhile. Errors: not-found; bad-request for a range outside the blob.
  virtual Result<std::unique_ptr<BlobReader>> read(std::string_view id, int64_t offset,
                                                   int64_t bytes) const = 0;
  // A file of this machine with the blob's bytes, named by its id: to open it or to link it for a
  // worker at once, and not to write to it. The store may remove it with the blob. Errors:
  // not-found.
  virtual Result<std::filesystem::path> local_file(std::string_view id) const = 0;
  // Ids of all blobs in ascending order.
  virtual Result<std::vector<std::string>> list() const = 0;
  // Removes the blob at once, in a time independent of its size. Errors: not-found; conflict while
  // the blob is pinned.
  virtual Status remove(std::string_view id) = 0;
  // Blobs that may no longer be needed, each once: those whose last pin was dropped since the last
  // call (an abandoned upload, or one that was pinned at its removal), and those passed to
  // suspect(). The owner of the database calls this now and then.
  virtual std::set<std::string> take_suspects() = 0;
  virtual void suspect(std::string id) = 0;
};

// All bytes of a blob. Errors: those of ObjectStore::read().
Result<std::vector<uint8_t>> read_blob(const ObjectStore& store, std::string_view id);

}  // namespace voxeld
