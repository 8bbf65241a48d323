#include "server/scene/core/bundle.h"

#include <zip.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <utility>

#include "proto/limits.h"
#include "proto/text/text_file.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"

namespace voxeld {

std::optional<NameMatch> Bundle::resolve(std::string_view reference, std::string_view from) const {
  std::vector<std::string> names;
  for (const Entry& entry : entries()) names.push_back(entry.name);
  return FileNames(std::move(names)).resolve(reference, from);
}

void warn_assumed_file(Scene& scene, const Bundle& bundle, std::string_view reference,
                       std::string_view from, std::string_view needed_by) {
  const auto found = bundle.resolve(reference, from);
  if (!found || found->guess.empty()) return;
  add_warning(scene, "assumed-file",
              std::string(reference) + ", named by " + std::string(needed_by) + ": " +
                  bundle.entries()[found->index].name + " is taken for it (" + found->guess + ")");
}

// --- one mesh file, and several uploads

namespace {

class FilesBundle final : public Bundle {
 public:
  explicit FilesBundle(const std::vector<BundledFile>& files) {
    std::vector<std::string> names;
    for (const BundledFile& file : files) {
      names.push_back(normalized_name(file.name).value_or(std::string(base_name(file.name))));
      entries_.push_back({names.back(), static_cast<int64_t>(file.bytes.size())});
      bytes_.push_back(file.bytes);
    }
    names_ = FileNames(std::move(names));
  }

  const std::vector<Entry>& entries() const override { return entries_; }
  std::optional<NameMatch> resolve(std::string_view reference,
                                   std::string_view from) const override {
    return names_.resolve(reference, from);
  }
  Result<std::optional<std::vector<uint8_t>>> find(std::string_view reference,
                                                   std::string_view from) const override {
    const auto found = resolve(reference, from);
    if (!found) return std::optional<std::vector<uint8_t>>();
    const std::span<const uint8_t> bytes = bytes_[found->index];
    return std::optional(copied_in_pieces(bytes.data(), bytes.size()));
  }

 private:
  std::vector<Entry> entries_;
  FileNames names_;
  std::vector<std::span<const uint8_t>> bytes_;
};

}  // namespace

bool is_image_name(std::string_view name) {
  const size_t dot = name.rfind('.');
  if (dot == name.npos) return false;
  for (const std::string_view extension :
       {"png", "jpg", "jpeg", "tga", "bmp", "dds", "webp", "hdr", "tif", "tiff", "gif"}) {
    if (equals_ignoring_case(name.substr(dot + 1), extension)) return true;
  }
  return false;
}

std::unique_ptr<Bundle> files_bundle(const std::vector<BundledFile>& files) {
  return std::make_unique<FilesBundle>(files);
}

std::unique_ptr<Bundle> single_file_bundle(std::string filename, std::span<const uint8_t> bytes) {
  return files_bundle({{std::move(filename), bytes}});
}

// --- a zip from outside; libzip reads it from memory. Every claim of its headers is checked
// against limits.h first, and again while inflating.

namespace {

struct ZipCloser {
  void operator()(zip_t* archive) const { zip_discard(archive); }
};
struct ZipFileCloser {
  void operator()(zip_file_t* file) const { zip_fclose(file); }
};

constexpr size_t kEndRecordBytes = 22;
constexpr size_t kEndRecordSearchBytes = 65'535 + kEndRecordBytes;
// Bytes of names, extra fields and comments of all entries. More: malformed-bundle. libzip
// allocates about 200 bytes per 46 bytes of this table, so it must be bounded before libzip sees
// the archive.
constexpr uint64_t kDirectoryBytesMax = uint64_t{limits::kBundleEntriesMax} * 4096;
constexpr uint64_t kRatioCheckedFromBytes = 1 << 20;
constexpr size_t kBytesAtOnce = size_t{1} << 20;  // between two cancel points
// A mesh may name one file again and again. The limit on inflated bytes is kRepeatsMax times all
// files, plus kInflatedBytesMin. More: malformed-bundle.
constexpr int64_t kRepeatsMax = 4;
constexpr int64_t kInflatedBytesMin = int64_t{64} << 20;

Error malformed(const std::string& what, std::string expected = {}, std::string got = {}) {
  return {ErrorCode::kMalformedBundle, "zip: " + what, std::move(expected), std::move(got)};
}

uint64_t little_endian(const uint8_t* at, int byte_count) {
  uint64_t value = 0;
  for (int i = byte_count; i-- > 0;) value = value << 8 | at[i];
  return value;
}

Status check_directory(uint64_t entry_count, uint64_t directory_bytes) {
  if (entry_count > limits::kBundleEntriesMax) {
    return malformed("too many entries", "at most " + std::to_string(limits::kBundleEntriesMax),
                     std::to_string(entry_count));
  }
  if (directory_bytes > kDirectoryBytesMax) {
    return malformed("central directory too large",
                     "at most " + std::to_string(kDirectoryBytesMax) + " bytes",
                     std::to_string(directory_bytes));
  }
  return {};
}

// Refuses names with a NUL, where libzip would end the name. Bytes that are no directory are left
// to libzip, which refuses them.
Status check_names(std::span<const uint8_t> bytes, uint64_t offset, uint64_t directory_bytes) {
  constexpr size_t kHeaderBytes = 46;
  if (offset > bytes.size()) return {};
  std::span<const uint8_t> rest =
      bytes.subspan(offset, std::min<uint64_t>(directory_bytes, bytes.size() - offset));
  while (rest.size() >= kHeaderBytes && std::memcmp(rest.data(), "PK\1\2", 4) == 0) {
    const size_t name_bytes = little_endian(rest.data() + 28, 2);
    const size_t entry_bytes = kHeaderBytes + name_bytes + little_endian(rest.data() + 30, 2) +
                               little_endian(rest.data() + 32, 2);
    if (entry_bytes > rest.size()) return {};
    const std::span<const uint8_t> name = rest.subspan(kHeaderBytes, name_bytes);
    if (std::find(name.begin(), name.end(), 0) != name.end()) {
      const std::string text(name.begin(), name.end());
      return malformed("entry " + shown(text) + " has a NUL in its name");
    }
    rest = rest.subspan(entry_bytes);
  }
  return {};
}

// Reads every record at the end of the archive that a reader might use, without trusting any:
// entries and size of the central directory, and its names (APPNOTE 4.3.12 to 4.3.16).
Status check_end_records(std::span<const uint8_t> bytes) {
  const size_t size = bytes.size();
  if (size < kEndRecordBytes)
    return malformed("truncated", "at least 22 bytes", std::to_string(size));
  bool found = false;
  uint64_t all_directory_bytes = 0;  // summed, so many records cost no more than one
  const size_t first = size > kEndRecordSearchBytes ? size - kEndRecordSearchBytes : 0;
  for (size_t at = first; at + kEndRecordBytes <= size; ++at) {
    const uint8_t* record = bytes.data() + at;
    if (std::memcmp(record, "PK\5\6", 4) != 0) continue;
    found = true;
    const uint64_t entry_count = little_endian(record + 10, 2);
    const uint64_t directory_bytes = little_endian(record + 12, 4);
    const bool zip64 = at >= 20 && std::memcmp(record - 20, "PK\6\7", 4) == 0;
    if (!zip64) {
      all_directory_bytes += directory_bytes;
      VOXELD_TRY(check_directory(entry_count, all_directory_bytes));
      VOXELD_TRY(check_names(bytes, little_endian(record + 16, 4), directory_bytes));
      continue;
    }
    const uint64_t offset = little_endian(record - 20 + 8, 8);
    if (offset > size || size - offset < 56 ||
        std::memcmp(bytes.data() + offset, "PK\6\6", 4) != 0) {
      return malformed("broken zip64 end record");
    }
    const uint8_t* record64 = bytes.data() + offset;
    const uint64_t directory_bytes64 = little_endian(record64 + 40, 8);
    VOXELD_TRY(check_directory(little_endian(record64 + 32, 8), directory_bytes64));
    all_directory_bytes += directory_bytes64;
    VOXELD_TRY(check_directory(0, all_directory_bytes));
    VOXELD_TRY(check_names(bytes, little_endian(record64 + 48, 8), directory_bytes64));
  }
  if (!found) return malformed("no end record: truncated, or not a zip");
  return {};
}

using ZipPointer = std::unique_ptr<zip_t, ZipCloser>;

Result<ZipPointer> open_archive(std::span<const uint8_t> bytes) {
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* source = zip_source_buffer_create(bytes.data(), bytes.size(), 0, &error);
  zip_t* archive = source == nullptr ? nullptr : zip_open_from_source(source, ZIP_RDONLY, &error);
  std::string why = archive == nullptr ? zip_error_strerror(&error) : "";
  zip_error_fini(&error);
  if (archive == nullptr) {
    if (source != nullptr) zip_source_free(source);
    return malformed(why);
  }
  return ZipPointer(archive);
}

class ZipBundle final : public Bundle {
 public:
  ZipBundle(ZipPointer archive, uint64_t archive_bytes)
      : archive_(std::move(archive)), archive_bytes_(archive_bytes) {}

  // Checks every entry's headers without inflating.
  Status read_directory() {
    const zip_int64_t count = zip_get_num_entries(archive_.get(), 0);
    VOXELD_TRY(check_directory(static_cast<uint64_t>(count), 0));
    uint64_t inflated_bytes = 0, stored_bytes = 0;
    for (zip_int64_t i = 0; i < count; ++i) {
      const auto index = static_cast<zip_uint64_t>(i);
      zip_stat_t stat;
      zip_stat_init(&stat);
      if (zip_stat_index(archive_.get(), index, 0, &stat) != 0) {
        return malformed("entry " + std::to_string(i) + ": " +
                         zip_error_strerror(zip_get_error(archive_.get())));
      }
      VOXELD_TRY(check_entry(index, stat));
      inflated_bytes += stat.size;
      stored_bytes += stat.comp_size;
      VOXELD_TRY(check_sums(inflated_bytes, stored_bytes));
    }
    names_ = FileNames(written_names_);
    return {};
  }

  const std::vector<Entry>& entries() const override { return entries_; }

  std::optional<NameMatch> resolve(std::string_view reference,
                                   std::string_view from) const override {
    // entries() has libzip's reading of names that are not UTF-8.
    const auto entry = find_entry(from.empty() ? reference : from);
    if (entry && from.empty()) return NameMatch{*entry, ""};
    return names_.resolve(reference, entry ? written_names_[*entry] : from);
  }

  Result<std::optional<std::vector<uint8_t>>> find(std::string_view reference,
                                                   std::string_view from) const override {
    const auto found = resolve(reference, from);
    if (!found) return std::optional<std::vector<uint8_t>>();
    VOXELD_ASSIGN(std::vector<uint8_t> bytes, inflate(found->index));
    return std::optional<std::vector<uint8_t>>(std::move(bytes));
  }

 private:
  std::optional<size_t> find_entry(std::string_view name) const {
    const auto found = std::ranges::find(entries_, name, &Entry::name);
    if (found == entries_.end()) return std::nullopt;
    return static_cast<size_t>(found - entries_.begin());
  }

  Status check_entry(zip_uint64_t index, const zip_stat_t& stat) {
    constexpr zip_uint64_t kNeeded =
        ZIP_STAT_NAME | ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE | ZIP_STAT_ENCRYPTION_METHOD;
    if ((stat.valid & kNeeded) != kNeeded) {
      return malformed("entry " + std::to_string(index) + ": incomplete header");
    }
    const std::string_view name = stat.name;
    const std::string where = "entry " + shown(name);
    if (stat.encryption_method != ZIP_EM_NONE) return malformed(where + " is encrypted");
    VOXELD_TRY(check_name(name, where));
    VOXELD_TRY(check_is_file(index, where));
    if (stat.comp_size > archive_bytes_) {
      return malformed(where + ": larger than the zip itself",
                       "at most " + std::to_string(archive_bytes_) + " bytes",
                       std::to_string(stat.comp_size));
    }
    const bool is_flat =
        stat.size > kRatioCheckedFromBytes && stat.size / limits::kBundleRatioMax > stat.comp_size;
    if (is_flat && !takes_flat(name, stat.size)) {
      return malformed(where + ": inflates too much",
                       "at most " + std::to_string(limits::kBundleRatioMax) + " times",
                       std::to_string(stat.comp_size) + " bytes to " + std::to_string(stat.size));
    }
    if (name.back() == '/' || name.back() == '\\') return {};  // a folder
    entries_.push_back({*normalized_name(name), static_cast<int64_t>(stat.size)});
    const char* written = zip_get_name(archive_.get(), index, ZIP_FL_ENC_RAW);
    written_names_.emplace_back(written == nullptr ? entries_.back().name : written);
    all_bytes_ += entries_.back().bytes;
    indices_.push_back(index);
    return {};
  }

  static Status check_name(std::string_view name, const std::string& where) {
    if (name.empty()) return malformed("an entry without a name");
    for (size_t begin = 0; begin <= name.size();) {
      const size_t end = std::min(name.find_first_of("/\\", begin), name.size());
      if (name.substr(begin, end - begin) == "..") {
        return malformed(where + " leaves the bundle by \"..\"");
      }
      begin = end + 1;
    }
    if (!normalized_name(name)) return malformed(where + " has an absolute or empty path");
    return {};
  }

  // Whether an entry above kBundleRatioMax may be.
  bool takes_flat(std::string_view name, uint64_t bytes) {
    constexpr uint64_t kMax = limits::kBundleFlatBytesMax;
    if (!is_image_name(name) || bytes > kMax - flat_bytes_) return false;
    flat_bytes_ += bytes;
    return true;
  }

  Status check_is_file(zip_uint64_t index, const std::string& where) {
    zip_uint8_t system = 0;
    zip_uint32_t attributes = 0;
    zip_file_get_external_attributes(archive_.get(), index, 0, &system, &attributes);
    if (system != ZIP_OPSYS_UNIX && system != ZIP_OPSYS_OS_X) return {};
    constexpr uint32_t kTypeMask = 0170000, kFile = 0100000, kFolder = 0040000;
    const uint32_t type = attributes >> 16 & kTypeMask;
    if (type == 0 || type == kFile || type == kFolder) return {};
    return malformed(where + " is a link or device, not a file");
  }

  Status check_sums(uint64_t inflated_bytes, uint64_t stored_bytes) const {
    if (inflated_bytes > limits::kBundleInflatedBytesMax) {
      return malformed("inflates too much",
                       "at most " + std::to_string(limits::kBundleInflatedBytesMax) + " bytes",
                       std::to_string(inflated_bytes));
    }
    if (stored_bytes > archive_bytes_) {
      return malformed("entries overlap: together larger than the zip itself",
                       "at most " + std::to_string(archive_bytes_) + " bytes",
                       std::to_string(stored_bytes));
    }
    return {};
  }

  // Inflates one entry. The result never exceeds the entry's declared size, which was checked
  // before.
  Result<std::vector<uint8_t>> inflate(size_t entry) const {
    const std::string where = "entry " + shown(entries_[entry].name);
    const std::unique_ptr<zip_file_t, ZipFileCloser> file(
        zip_fopen_index(archive_.get(), indices_[entry], 0));
    if (!file) return malformed(where + ": " + zip_error_strerror(zip_get_error(archive_.get())));
    const auto declared = static_cast<size_t>(entries_[entry].bytes);
    inflated_bytes_ += entries_[entry].bytes;
    const int64_t inflated_max = kRepeatsMax * all_bytes_ + kInflatedBytesMin;
    if (inflated_bytes_ > inflated_max) {
      return malformed(where + ": the bundle's files are read too often",
                       "at most " + std::to_string(inflated_max) + " bytes to inflate in all",
                       std::to_string(inflated_bytes_));
    }
    std::vector<uint8_t> bytes;
    bytes.reserve(declared);
    size_t read = 0;
    while (read < declared) {
      cancel_point();
      bytes.resize(read + std::min(declared - read, kBytesAtOnce));
      const zip_int64_t count = zip_fread(file.get(), bytes.data() + read, bytes.size() - read);
      if (count < 0) return malformed(where + ": " + read_error(file.get()));
      if (count == 0) break;
      read += static_cast<size_t>(count);
    }
    // Reading one byte more makes libzip compare the checksum, and reveals a stream that is too
    // long.
    uint8_t beyond = 0;
    const zip_int64_t more = read == declared ? zip_fread(file.get(), &beyond, 1) : 0;
    if (more < 0) return malformed(where + ": " + read_error(file.get()));
    if (read != declared || more > 0) {
      return malformed(where + ": wrong size", std::to_string(declared) + " bytes",
                       more > 0 ? "more" : std::to_string(read));
    }
    return bytes;
  }
  static std::string read_error(zip_file_t* file) {
    return zip_error_strerror(zip_file_get_error(file));
  }

  ZipPointer archive_;
  uint64_t archive_bytes_;
  int64_t all_bytes_ = 0;               // of all entries, inflated
  uint64_t flat_bytes_ = 0;             // of those above kBundleRatioMax, which are images
  mutable int64_t inflated_bytes_ = 0;  // so far
  std::vector<Entry> entries_;          // files only
  std::vector<std::string> written_names_;
  FileNames names_;                    // of written_names_
  std::vector<zip_uint64_t> indices_;  // of the files in the archive
};

}  // namespace

Result<std::unique_ptr<Bundle>> zip_bundle(std::span<const uint8_t> bytes) {
  VOXELD_TRY(check_end_records(bytes));
  VOXELD_ASSIGN(ZipPointer archive, open_archive(bytes));
  auto bundle = std::make_unique<ZipBundle>(std::move(archive), bytes.size());
  VOXELD_TRY(bundle->read_directory());
  return std::unique_ptr<Bundle>(std::move(bundle));
}

}  // namespace voxeld
