#include "tests/unit/store/memory_store.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "server/base/disk/file.h"
#include "server/base/sha256.h"

namespace voxeld::testing {

namespace fs = std::filesystem;

class MemoryStore::Sink final : public BlobSink {
 public:
  explicit Sink(std::shared_ptr<State> state) : state_(std::move(state)) {}
  Status write(std::span<const uint8_t> bytes) override {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return {};
  }
  Result<BlobInfo> finish(std::string id, int64_t) override {
    return put(state_, std::move(id), std::move(bytes_));
  }

 private:
  const std::shared_ptr<State> state_;
  std::vector<uint8_t> bytes_;
};

namespace {

class RangeReader final : public BlobReader {
 public:
  RangeReader(std::shared_ptr<const std::vector<uint8_t>> blob, std::span<const uint8_t> range)
      : blob_(std::move(blob)), left_(range) {}
  Result<size_t> read(std::span<uint8_t> into) override {
    const size_t count = std::min(left_.size(), into.size());
    std::copy_n(left_.begin(), count, into.begin());
    left_ = left_.subspan(count);
    return count;
  }

 private:
  const std::shared_ptr<const std::vector<uint8_t>> blob_;
  std::span<const uint8_t> left_;
};

}  // namespace

MemoryStore::MemoryStore() : state_(std::make_shared<State>()) {}

BlobInfo MemoryStore::put(const std::shared_ptr<State>& state, std::string id,
                          std::vector<uint8_t> bytes) {
  const auto size = static_cast<int64_t>(bytes.size());
  {
    const MutexLock lock(state->mutex);
    state->blobs[id] = std::make_shared<const std::vector<uint8_t>>(std::move(bytes));
    state->pins.insert(id);
  }
  const auto unpin = [state, id](const void*) {
    const MutexLock lock(state->mutex);
    state->pins.erase(state->pins.find(id));
    if (!state->pins.contains(id)) state->suspects.insert(id);
  };
  return {id, size, std::shared_ptr<const void>(state.get(), unpin)};
}

Result<MemoryStore::Bytes> MemoryStore::find(std::string_view id) const {
  const MutexLock lock(state_->mutex);
  const auto it = state_->blobs.find(id);
  if (it == state_->blobs.end()) return Error{ErrorCode::kNotFound, "no such blob", "", ""};
  return it->second;
}

Result<BlobWriter> MemoryStore::begin(int64_t bytes_max, Durability /*durability*/) {
  return BlobWriter(std::make_unique<Sink>(state_), bytes_max);
}

Result<BlobInfo> MemoryStore::adopt(const fs::path& file, Durability /*durability*/) {
  if (!fs::is_regular_file(fs::symlink_status(file))) {
    return Error{ErrorCode::kInternal, "not a regular file", "", ""};
  }
  VOXELD_ASSIGN(std::vector<uint8_t> bytes, read_file(file));
  fs::remove(file);
  Sha256 hash;
  hash.update(bytes);
  return put(state_, hash.finish_id(), std::move(bytes));
}

Result<BlobInfo> MemoryStore::stat(std::string_view id) const {
  VOXELD_ASSIGN(const Bytes bytes, find(id));
  return BlobInfo{std::string(id), static_cast<int64_t>(bytes->size())};
}

Result<BlobInfo> MemoryStore::verified(std::string_view id) const {
  VOXELD_ASSIGN(const Bytes bytes, find(id));
  Sha256 hash;
  hash.update(*bytes);
  if (hash.finish_id() != id) return Error{ErrorCode::kGone, "damaged", "", ""};
  return BlobInfo{std::string(id), static_cast<int64_t>(bytes->size())};
}

bool MemoryStore::is_usable(std::string_view id) const {
  return static_cast<bool>(verified(id));
}

Result<std::unique_ptr<BlobReader>> MemoryStore::read(std::string_view id, int64_t offset,
                                                      int64_t bytes) const {
  VOXELD_ASSIGN(Bytes blob, find(id));
  const int64_t size = std::ssize(*blob);
  if (offset < 0 || bytes < 0 || offset > size || bytes > size - offset) {
    return Error{ErrorCode::kBadRequest, "a range outside the blob", "", ""};
  }
  const std::span<const uint8_t> all(*blob);
  const auto range = all.subspan(static_cast<size_t>(offset), static_cast<size_t>(bytes));
  return std::unique_ptr<BlobReader>(std::make_unique<RangeReader>(std::move(blob), range));
}

Result<fs::path> MemoryStore::local_file(std::string_view id) const {
  VOXELD_ASSIGN(const Bytes bytes, find(id));
  const fs::path file = files_.path() / id;
  VOXELD_TRY(write_file(file, *bytes));
  return file;
}

Result<std::vector<std::string>> MemoryStore::list() const {
  const MutexLock lock(state_->mutex);
  std::vector<std::string> ids;
  for (const auto& [id, bytes] : state_->blobs) ids.push_back(id);
  return ids;
}

Status MemoryStore::remove(std::string_view id) {
  const MutexLock lock(state_->mutex);
  const auto it = state_->blobs.find(id);
  if (it == state_->blobs.end()) return Error{ErrorCode::kNotFound, "no such blob", "", ""};
  if (state_->pins.contains(id)) return Error{ErrorCode::kConflict, "pinned", "", ""};
  state_->blobs.erase(it);
  return {};
}

std::set<std::string> MemoryStore::take_suspects() {
  const MutexLock lock(state_->mutex);
  return std::exchange(state_->suspects, {});
}

void MemoryStore::suspect(std::string id) {
  const MutexLock lock(state_->mutex);
  state_->suspects.insert(std::move(id));
}

void MemoryStore::damage(std::string_view id) {
  const MutexLock lock(state_->mutex);
  Bytes& bytes = state_->blobs.find(id)->second;
  std::vector<uint8_t> changed = *bytes;
  changed.at(0) ^= 1;
  bytes = std::make_shared<const std::vector<uint8_t>>(std::move(changed));
}

}  // namespace voxeld::testing
