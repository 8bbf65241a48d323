#include "server/api/resources/zarr_member.h"

#include <string>

#include "proto/text/client_texts.h"

namespace voxeld::api {
namespace {

// PKWARE's APPNOTE 6.3: 4.3.12 (an entry of the directory), 4.3.14 (its end in zip64), 4.5.3 (the
// extra field of zip64).
constexpr uint32_t kEntry = 0x02014b50, kEnd64 = 0x06064b50;
constexpr size_t kEntryBytes = 46, kLocalBytes = 30, kLocalExtraBytes = 20, kExtraBytes = 28;
constexpr size_t kEndBytes = 56 + 20 + 22;  // of zip64, its locator, and of the archive

template <typename T>
T number_at(std::span<const uint8_t> bytes, uint64_t at) {
  T value = 0;
  for (size_t i = 0; i < sizeof value; ++i) {
    value = static_cast<T>(value | static_cast<T>(T{bytes[at + i]} << (8 * i)));
  }
  return value;
}

Error no_store(std::string_view expected, uint64_t got) {
  return {ErrorCode::kInternal, "the stored archive", std::string(expected), std::to_string(got)};
}

}  // namespace

Result<ZipMember> find_zip_member(std::span<const uint8_t> archive, std::string_view name) {
  if (archive.size() < kEndBytes) return no_store("at least 98 bytes", archive.size());
  const uint64_t end = archive.size() - kEndBytes;
  const auto signature = number_at<uint32_t>(archive, end);
  if (signature != kEnd64) return no_store("an end of zip64", signature);
  const auto bytes = number_at<uint64_t>(archive, end + 40);
  const auto begin = number_at<uint64_t>(archive, end + 48);
  if (begin > end || bytes != end - begin) return no_store("a directory before its end", begin);
  for (uint64_t at = begin; at < end;) {
    if (end - at < kEntryBytes) return no_store("a whole entry", end - at);
    if (number_at<uint32_t>(archive, at) != kEntry) return no_store("an entry", at);
    const auto name_bytes = number_at<uint16_t>(archive, at + 28);
    const auto extra_bytes = number_at<uint16_t>(archive, at + 30);
    const uint64_t entry_bytes = kEntryBytes + name_bytes + kExtraBytes;
    if (extra_bytes != kExtraBytes || end - at < entry_bytes) return no_store("a whole entry", at);
    const std::string_view found(reinterpret_cast<const char*>(&archive[at + kEntryBytes]),
                                 name_bytes);
    if (found == name) {
      if (const auto method = number_at<uint16_t>(archive, at + 10); method != 0) {
        return no_store("a stored member", method);
      }
      const uint64_t extra = at + kEntryBytes + name_bytes;
      const auto stored = number_at<uint64_t>(archive, extra + 12);
      const auto local = number_at<uint64_t>(archive, extra + 20);
      const uint64_t head = kLocalBytes + name_bytes + kLocalExtraBytes;
      if (local > begin || head > begin - local || stored > begin - local - head) {
        return no_store("a member before the directory", local);
      }
      return ZipMember{local + head, stored};
    }
    at += entry_bytes;
  }
  return Error{ErrorCode::kNotFound, "the Zarr store has no such key",
               "a document or a chunk with voxels", echoed(name)};
}

}  // namespace voxeld::api
