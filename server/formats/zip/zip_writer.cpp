#include "server/formats/zip/zip_writer.h"

#include <libdeflate.h>
#include <zlib.h>

#include <algorithm>

namespace voxeld {
namespace {

constexpr size_t kPendingBytesMax = size_t{32} << 20;  // deflated together
constexpr uint16_t kZipVersion = 45;                   // zip64
constexpr uint16_t kStored = 0, kDeflated = 8;
constexpr uint64_t kCountMax = 0xffff;  // of members in the end record that is not zip64
constexpr uint16_t kDosDate = 0x21;     // 1980-01-01, the earliest date of a zip
constexpr uint32_t kIn64 = 0xffffffff;
constexpr uint16_t kExtra64 = 1;
constexpr size_t kLocalCrcByte = 14, kLocalFixedBytes = 30;

class ZipRecord {
 public:
  template <typename T>
  ZipRecord& put(T value) {
    for (size_t i = 0; i < sizeof value; ++i) {
      bytes_.push_back(static_cast<uint8_t>(value >> (8 * i)));
    }
    return *this;
  }
  ZipRecord& put(const std::string& text) {
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    return *this;
  }
  const std::vector<uint8_t>& bytes() const { return bytes_; }

 private:
  std::vector<uint8_t> bytes_;
};

}  // namespace

Status ZipWriter::append_local(const Member& member) {
  ZipRecord local;
  local.put(uint32_t{0x04034b50}).put(kZipVersion).put(uint16_t{0}).put(member.method);
  local.put(uint16_t{0}).put(kDosDate).put(member.crc).put(kIn64).put(kIn64);
  local.put(static_cast<uint16_t>(member.name.size())).put(uint16_t{20}).put(member.name);
  local.put(kExtra64).put(uint16_t{16}).put(member.raw_bytes).put(member.stored_bytes);
  return file_.append(local.bytes());
}

Status ZipWriter::begin(const std::string& name) {
  VOXELD_TRY(end_member());
  Member& member = members_.emplace_back();
  member.name = name;
  member.offset = file_.size();
  member.method = kDeflated;
  is_open_ = true;
  return append_local(member);  // checksum and lengths are filled in once they are known
}

Status ZipWriter::store(const std::string& name, std::span<const uint8_t> bytes) {
  VOXELD_TRY(end_member());
  Member& member = members_.emplace_back();
  member.name = name;
  member.offset = file_.size();
  member.raw_bytes = member.stored_bytes = bytes.size();
  member.crc = libdeflate_crc32(0, bytes.data(), bytes.size());
  member.method = kStored;
  VOXELD_TRY(append_local(member));
  return file_.append(bytes);
}

Status ZipWriter::add(std::span<const uint8_t> bytes) {
  while (!bytes.empty()) {
    const auto part = bytes.first(std::min(bytes.size(), kPendingBytesMax - pending_.size()));
    pending_.insert(pending_.end(), part.begin(), part.end());
    bytes = bytes.subspan(part.size());
    if (pending_.size() == kPendingBytesMax) VOXELD_TRY(deflate_pending());
  }
  return {};
}

Status ZipWriter::add_pieces(size_t count, const std::function<size_t(size_t)>& bytes_of,
                             const std::function<void(size_t, std::span<uint8_t>)>& fill,
                             const Repeats& repeats) {
  VOXELD_TRY(deflate_pending());
  return deflate_pieces(count, bytes_of, fill, repeats, Checksum::kCrc32,
                        [this](const DeflatedPiece& piece) { return append(piece); });
}

Status ZipWriter::deflate_pending() {
  VOXELD_TRY(deflate_bytes(pending_, Checksum::kCrc32,
                           [this](const DeflatedPiece& piece) { return append(piece); }));
  pending_.clear();
  return {};
}

Status ZipWriter::append(const DeflatedPiece& piece) {
  Member& member = members_.back();
  member.crc = static_cast<uint32_t>(
      crc32_combine(member.crc, piece.checksum, static_cast<z_off_t>(piece.raw_bytes)));
  member.raw_bytes += piece.raw_bytes;
  member.stored_bytes += piece.deflated.size();
  return file_.append(piece.deflated);
}

Status ZipWriter::end_member() {
  if (!is_open_) return {};
  is_open_ = false;
  VOXELD_TRY(deflate_pending());
  Member& member = members_.back();
  const std::span<const uint8_t> end = Deflater::stream_end();
  member.stored_bytes += end.size();
  VOXELD_TRY(file_.append(end));
  VOXELD_TRY(file_.replace(member.offset + kLocalCrcByte, ZipRecord().put(member.crc).bytes()));
  const size_t extra = kLocalFixedBytes + member.name.size() + 4;
  return file_.replace(member.offset + extra,
                       ZipRecord().put(member.raw_bytes).put(member.stored_bytes).bytes());
}

Status ZipWriter::finish() {
  VOXELD_TRY(end_member());
  const uint64_t directory = file_.size();
  ZipRecord out;
  for (const Member& member : members_) {
    out.put(uint32_t{0x02014b50})
        .put(kZipVersion)
        .put(kZipVersion)
        .put(uint16_t{0})
        .put(member.method);
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
  const auto short_count = static_cast<uint16_t>(std::min(count, kCountMax));
  out.put(uint32_t{0x06054b50}).put(uint16_t{0}).put(uint16_t{0}).put(short_count);
  out.put(short_count).put(kIn64).put(kIn64).put(uint16_t{0});
  return file_.append(out.bytes());
}

}  // namespace voxeld
