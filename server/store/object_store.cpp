#include "server/store/object_store.h"

#include "server/base/check.h"

namespace voxeld {

Status BlobWriter::append(std::span<const uint8_t> bytes) {
  VOXELD_CHECK(sink_ != nullptr, "append after finish");
  const auto count = static_cast<int64_t>(bytes.size());
  if (count > bytes_max_ - bytes_) {
    is_broken_ = true;
    return Error{ErrorCode::kPayloadTooLarge, "the upload is too large",
                 "at most " + std::to_string(bytes_max_) + " bytes",
                 "at least " + std::to_string(bytes_ + count)};
  }
  if (Status written = sink_->write(bytes); !written) {
    is_broken_ = true;
    return written;
  }
  hash_.update(bytes);
  bytes_ += count;
  return {};
}

Result<BlobInfo> BlobWriter::finish() {
  VOXELD_CHECK(sink_ != nullptr && !is_broken_, "finish after a failed append or twice");
  VOXELD_ASSIGN(BlobInfo info, sink_->finish(hash_.finish_id(), bytes_));
  sink_.reset();
  return info;
}

Result<std::vector<uint8_t>> read_blob(const ObjectStore& store, std::string_view id) {
  VOXELD_ASSIGN(const BlobInfo info, store.stat(id));
  VOXELD_ASSIGN(const auto reader, store.read(id, 0, info.bytes));
  std::vector<uint8_t> bytes(static_cast<size_t>(info.bytes));
  VOXELD_ASSIGN(const size_t count, reader->read(bytes));
  bytes.resize(count);
  return bytes;
}

}  // namespace voxeld
