#include "server/jobs/estimates/job_input.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <optional>
#include <vector>

namespace voxeld {
namespace {

// Records of a zip archive (PKWARE, APPNOTE.TXT 6.3.10, sections 4.3.12 and 4.3.16).
constexpr std::string_view kMember = "PK\3\4", kEntry = "PK\1\2", kEnd = "PK\5\6";
constexpr size_t kEntryBytes = 46, kEndBytes = 22;
// An archive may end with a comment of 64 KiB. Directories that are longer are not read.
constexpr int64_t kTailBytes = 65536 + kEndBytes, kDirectoryBytes = 1 << 20;
constexpr int64_t kHeadBytes = 512;
constexpr std::string_view kGlb = "glTF";  // glTF 2.0, 4.4.1

std::vector<uint8_t> read_part(const ObjectStore& blobs, std::string_view id, int64_t offset,
                               int64_t bytes) {
  const auto reader = blobs.read(id, offset, bytes);
  if (!reader) return {};
  std::vector<uint8_t> part(static_cast<size_t>(bytes));
  const auto count = (*reader)->read(part);
  part.resize(count ? *count : 0);
  return part;
}

template <typename T>
T little_endian(const std::vector<uint8_t>& bytes, size_t at) {
  static_assert(std::endian::native == std::endian::little);
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

bool starts_with(const std::vector<uint8_t>& bytes, size_t at, std::string_view text) {
  return bytes.size() >= at + text.size() &&
         std::equal(text.begin(), text.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at),
                    [](char a, uint8_t b) { return static_cast<uint8_t>(a) == b; });
}

// The sum of what the directory of an archive says of its members; nothing if it is not complete.
std::optional<int64_t> unpacked_bytes(const ObjectStore& blobs, std::string_view id,
                                      int64_t bytes) {
  const int64_t tail_begin = std::max<int64_t>(0, bytes - kTailBytes);
  const std::vector<uint8_t> tail = read_part(blobs, id, tail_begin, bytes - tail_begin);
  size_t end = tail.size();
  while (end > 0 && !starts_with(tail, end - 1, kEnd)) --end;
  if (end == 0 || --end + kEndBytes > tail.size()) return std::nullopt;
  const int64_t directory_bytes = little_endian<uint32_t>(tail, end + 12);
  const int64_t begin = little_endian<uint32_t>(tail, end + 16);
  if (directory_bytes > kDirectoryBytes || begin + directory_bytes > bytes) return std::nullopt;
  const std::vector<uint8_t> directory = read_part(blobs, id, begin, directory_bytes);
  int64_t sum = 0;
  for (size_t at = 0; at < directory.size();) {
    if (!starts_with(directory, at, kEntry) || at + kEntryBytes > directory.size()) {
      return std::nullopt;
    }
    sum += little_endian<uint32_t>(directory, at + 24);
    at += kEntryBytes + little_endian<uint16_t>(directory, at + 28) +
          little_endian<uint16_t>(directory, at + 30) + little_endian<uint16_t>(directory, at + 32);
  }
  return sum;
}

}  // namespace

std::string_view form_name(JobInput::Form form) {
  constexpr std::array<std::string_view, 5> kNames = {"grid", "binary", "text", "zip", "glb"};
  return kNames[static_cast<size_t>(form)];
}

JobInput file_input(const ObjectStore& blobs, std::string_view id) {
  JobInput input;
  const auto blob = blobs.stat(id);
  if (!blob || blob->bytes == 0) return input;
  input.bytes = blob->bytes;
  const std::vector<uint8_t> head = read_part(blobs, id, 0, std::min(blob->bytes, kHeadBytes));
  if (starts_with(head, 0, kMember)) {
    input.form = JobInput::Form::kZip;
    const auto unpacked = unpacked_bytes(blobs, id, blob->bytes);
    input.bytes = std::max(unpacked.value_or(0), blob->bytes);
  } else if (starts_with(head, 0, kGlb)) {
    input.form = JobInput::Form::kGlb;
  } else if (std::ranges::find(head, uint8_t{0}) == head.end()) {
    input.form = JobInput::Form::kText;
  }
  return input;
}

}  // namespace voxeld
