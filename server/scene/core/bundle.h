// The files of one upload. No file system is used: everything comes from the upload.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/file_names/file_names.h"
#include "proto/result.h"
#include "server/scene/core/scene.h"

namespace voxeld {

// Whether a file is an image by the extension of its name.
bool is_image_name(std::string_view name);

// The files of one upload: a single mesh, a zip with a mesh and its files, or the files of several
// uploads. FileNames (proto/file_names) tells which file a reference means. Nothing outside the
// upload is ever opened.
class Bundle {
 public:
  virtual ~Bundle() = default;
  struct Entry {
    std::string name;
    int64_t bytes = 0;
  };
  virtual const std::vector<Entry>& entries() const = 0;
  // The entry that `reference` means in the file `from` ("models/a.obj"); nullopt if there is none.
  virtual std::optional<NameMatch> resolve(std::string_view reference, std::string_view from) const;
  // Bytes of that entry; nullopt if there is none. Errors: malformed-bundle (broken entry, over a
  // limit).
  virtual Result<std::optional<std::vector<uint8_t>>> find(std::string_view reference,
                                                           std::string_view from) const = 0;
};

// Adds the warning "assumed-file" if the file that is found for a reference is not just what it
// says. `needed_by` names the material or file.
void warn_assumed_file(Scene& scene, const Bundle& bundle, std::string_view reference,
                       std::string_view from, std::string_view needed_by);

// A bundle with only the mesh itself; `bytes` must outlive it.
std::unique_ptr<Bundle> single_file_bundle(std::string filename, std::span<const uint8_t> bytes);
// A zip, checked against limits.h: entries, inflated bytes, ratio, absolute and .. names, links,
// encryption. `bytes` must outlive it.
Result<std::unique_ptr<Bundle>> zip_bundle(std::span<const uint8_t> bytes);

// A file of a bundle that was uploaded file by file. Names are relative and without ".."
// (proto/messages/bundle_manifest.h). The bytes must outlive the bundle.
struct BundledFile {
  std::string name;
  std::span<const uint8_t> bytes;
};
std::unique_ptr<Bundle> files_bundle(const std::vector<BundledFile>& files);

}  // namespace voxeld
