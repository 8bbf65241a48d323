#include "server/formats/zip_writer.h"

#include <zlib.h>

#include <algorithm>
#include <utility>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

constexpr size_t kSliceBytes = size_t{1} << 20;
constexpr size_t kBatchSlices = 32;  // slices deflated together
constexpr int kDeflateLevel = 1;     // voxels are runs: more effort gains little
constexpr int kRawDeflate = -15;
constexpr int kMemoryLevel = 8;
constexpr uint16_t kZipVersion = 45;  // zip64
constexpr uint16_t kDeflated = 8;
constexpr uint16_t kDosDate = 0x21;  // 1980-01-01, the earliest date of a zip
constexpr uint32_t kIn64 = 0xffffffff;
constexpr uint16_t kExtra64 = 1;
constexpr size_t kLocalCrcByte = 14, kLocalFixedBytes = 30;

class Record {
 public:
  template <typename T>
  Record& put(T value) {
    for (size_t i = 0; i < sizeof value; ++i) {
      bytes_.push_back(static_cast<uint8_t>(value >> (8 * i)));
    }
    return *this;
  }
  Record& put(const std::string& text) {
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    return *this;
  }
  const std::vector<uint8_t>& bytes() const { return bytes_; }

 private:
  std::vector<uint8_t> bytes_;
};

struct Slice {
  std::vector<uint8_t> stored;
  uint32_t crc = 0;
  bool is_ok = false;
};

// Deflates one slice. Slices end at a byte, so consecutive ones form one deflate stream.
Slice deflate_slice(std::span<const uint8_t> raw, bool is_last) {
  Slice slice;
  slice.crc = static_cast<uint32_t>(crc32(0, raw.data(), static_cast<uInt>(raw.size())));
  z_stream stream{};
  if (deflateInit2(&stream, kDeflateLevel, Z_DEFLATED, kRawDeflate, kMemoryLevel,
                   Z_DEFAULT_STRATEGY) != Z_OK) {
    return slice;
  }
  constexpr size_t kFlushBytes = 16;
  slice.stored.resize(deflateBound(&stream, static_cast<uLong>(raw.size())) + kFlushBytes);
  stream.next_in = const_cast<Bytef*>(raw.data());  // zlib only reads it
  stream.avail_in = static_cast<uInt>(raw.size());
  stream.next_out = slice.stored.data();
  stream.avail_out = static_cast<uInt>(slice.stored.size());
  const int result = deflate(&stream, is_last ? Z_FINISH : Z_FULL_FLUSH);
  slice.is_ok = result == (is_last ? Z_STREAM_END : Z_OK) && stream.avail_in == 0;
  slice.stored.resize(stream.total_out);
  deflateEnd(&stream);
  return slice;
}

}  // namespace

Status ZipWriter::begin(const std::string& name) {
  VOXELD_TRY(end_member());
  Member& member = members_.emplace_back();
  member.name = name;
  member.offset = file_.size();
  is_open_ = true;
  Record local;  // checksum and lengths are filled in once they are known
  local.put(uint32_t{0x04034b50}).put(kZipVersion).put(uint16_t{0}).put(kDeflated);
  local.put(uint16_t{0}).put(kDosDate).put(uint32_t{0}).put(kIn64).put(kIn64);
  local.put(static_cast<uint16_t>(name.size())).put(uint16_t{20}).put(name);
  local.put(kExtra64).put(uint16_t{16}).put(uint64_t{0}).put(uint64_t{0});
  return file_.append(local.bytes());
}

Status ZipWriter::add(std::span<const uint8_t> bytes) {
  constexpr size_t kBatchBytes = kBatchSlices * kSliceBytes;
  members_.back().raw_bytes += bytes.size();
  while (!bytes.empty()) {
    const auto part = bytes.first(std::min(bytes.size(), kBatchBytes - pending_.size()));
    pending_.insert(pending_.end(), part.begin(), part.end());
    bytes = bytes.subspan(part.size());
    if (pending_.size() == kBatchBytes) VOXELD_TRY(deflate_pending(false));
  }
  return {};
}

Status ZipWriter::deflate_pending(bool is_last) {
  const std::span<const uint8_t> raw = pending_;
  std::vector<Slice> slices(std::max<size_t>((raw.size() + kSliceBytes - 1) / kSliceBytes, 1));
  ThreadPool::shared().for_each(slices.size(), [&](size_t i) {
    cancel_point();  // on the calling thread
    const size_t begin = i * kSliceBytes;
    slices[i] = deflate_slice(raw.subspan(begin, std::min(kSliceBytes, raw.size() - begin)),
                              is_last && i + 1 == slices.size());
  });
  Member& member = members_.back();
  for (size_t i = 0; i < slices.size(); ++i) {
    const Slice& slice = slices[i];
    if (!slice.is_ok) return Error{ErrorCode::kInternal, "zip: deflate failed", "", ""};
    const size_t raw_bytes = std::min(kSliceBytes, raw.size() - i * kSliceBytes);
    member.crc = static_cast<uint32_t>(
        crc32_combine(member.crc, slice.crc, static_cast<z_off_t>(raw_bytes)));
    member.stored_bytes += slice.stored.size();
    VOXELD_TRY(file_.append(slice.stored));
  }
  pending_.clear();
  return {};
}

Status ZipWriter::end_member() {
  if (!is_open_) return {};
  is_open_ = false;
  VOXELD_TRY(deflate_pending(true));
  const Member& member = members_.back();
  VOXELD_TRY(file_.replace(member.offset + kLocalCrcByte, Record().put(member.crc).bytes()));
  const size_t extra = kLocalFixedBytes + member.name.size() + 4;
  return file_.replace(member.offset + extra,
                       Record().put(member.raw_bytes).put(member.stored_bytes).bytes());
}

Status ZipWriter::finish() {
  VOXELD_TRY(end_member());
  const uint64_t directory = file_.size();
  Record out;
  for (const Member& member : members_) {
    out.put(uint32_t{0x02014b50}).put(kZipVersion).put(kZipVersion).put(uint16_t{0}).put(kDeflated);
    out.put(uint16_t{0}).put(kDosDate).put(member.crc).put(kIn64).put(kIn64);
    out.put(static_cast<uint16_t>(member.name.size())).put(uint16_t{28}).put(uint16_t{0});
    out.put(uint16_t{0}).put(uint16_t{0}).put(uint32_t{0}).put(kIn64).put(member.name);
    out.put(kExtra64).put(uint16_t{24}).put(member.raw_bytes).put(member.stored_bytes);
    out.put(member.offset);
  }
  const uint64_t directory_bytes = out.bytes().size(), count = members_.size();
  out.put(uint32_t{0x06064b50}).put(uint64_t{44}).put(kZipVersion).put(kZipVersion);
  out.put(uint32_t{0}).put(uint32_t{0}).put(count).put(count).put(directory_bytes).put(directory);
  out.put(uint32_t{0x07064b50}).put(uint32_t{0}).put(directory + directory_bytes);
  out.put(uint32_t{1});
  const auto short_count = static_cast<uint16_t>(count);
  out.put(uint32_t{0x06054b50}).put(uint16_t{0}).put(uint16_t{0}).put(short_count);
  out.put(short_count).put(kIn64).put(kIn64).put(uint16_t{0});
  return file_.append(out.bytes());
}

}  // namespace voxeld
