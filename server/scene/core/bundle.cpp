// The bundles of one mesh file and of several uploads. Zips are in zip_bundle.cpp.
#include <memory>
#include <utility>

#include "server/scene/core/bundle.h"
#include "server/scene/core/bundle_names.h"

namespace voxeld {
namespace {

class SingleFileBundle final : public Bundle {
 public:
  SingleFileBundle(std::string filename, std::span<const uint8_t> bytes)
      : entries_{{filename, static_cast<int64_t>(bytes.size())}},
        names_{normalized_name(filename).value_or(std::string(base_name(filename)))},
        bytes_(bytes) {}

  const std::vector<Entry>& entries() const override { return entries_; }
  Result<std::optional<std::vector<uint8_t>>> find(std::string_view reference,
                                                   std::string_view from) const override {
    if (!resolve_reference(names_, reference, from)) return std::optional<std::vector<uint8_t>>();
    return std::optional<std::vector<uint8_t>>(std::in_place, bytes_.begin(), bytes_.end());
  }

 private:
  std::vector<Entry> entries_;
  std::vector<std::string> names_;
  std::span<const uint8_t> bytes_;
};

class FilesBundle final : public Bundle {
 public:
  explicit FilesBundle(const std::vector<BundledFile>& files) {
    for (const BundledFile& file : files) {
      names_.push_back(normalized_name(file.name).value_or(std::string(base_name(file.name))));
      entries_.push_back({names_.back(), static_cast<int64_t>(file.bytes.size())});
      bytes_.push_back(file.bytes);
    }
  }

  const std::vector<Entry>& entries() const override { return entries_; }
  Result<std::optional<std::vector<uint8_t>>> find(std::string_view reference,
                                                   std::string_view from) const override {
    const auto found = resolve_reference(names_, reference, from);
    if (!found) return std::optional<std::vector<uint8_t>>();
    const std::span<const uint8_t> bytes = bytes_[*found];
    return std::optional<std::vector<uint8_t>>(std::in_place, bytes.begin(), bytes.end());
  }

 private:
  std::vector<Entry> entries_;
  std::vector<std::string> names_;
  std::vector<std::span<const uint8_t>> bytes_;
};

}  // namespace

std::unique_ptr<Bundle> files_bundle(const std::vector<BundledFile>& files) {
  return std::make_unique<FilesBundle>(files);
}

std::unique_ptr<Bundle> single_file_bundle(std::string filename, std::span<const uint8_t> bytes) {
  return std::make_unique<SingleFileBundle>(std::move(filename), bytes);
}

}  // namespace voxeld
