// Loads the bytes of an upload into a Scene. No file system is used: everything comes from the
// upload.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/scene/scene.h"

namespace voxeld {

enum class MeshFormat { kObj, kPly, kStl, kOff, kGltf, kGlb, kMd5, kZip };

// Detects the format by the file name's extension, else by the first bytes. Errors:
// unsupported-media-type, naming the formats that are read.
Result<MeshFormat> detect_format(std::string_view filename, std::span<const uint8_t> bytes);
std::string_view mesh_format_name(MeshFormat format);

// The files of one upload: a single mesh, a zip with a mesh and its files, or the files of several
// uploads. Names are matched as written, then case-insensitively, then by base name; backslashes
// count as slashes. Nothing outside the upload is ever opened.
class Bundle {
 public:
  virtual ~Bundle() = default;
  struct Entry {
    std::string name;
    int64_t bytes = 0;
  };
  virtual const std::vector<Entry>& entries() const = 0;
  // Bytes of the file that `reference` means in the file `from` ("models/a.obj"); nullopt if the
  // bundle has none. Errors: malformed-bundle (broken entry, over a limit).
  virtual Result<std::optional<std::vector<uint8_t>>> find(std::string_view reference,
                                                           std::string_view from) const = 0;
};

// A bundle with only the mesh itself; `bytes` must outlive it.
std::unique_ptr<Bundle> single_file_bundle(std::string filename, std::span<const uint8_t> bytes);
// A zip, checked against limits.h: entries, inflated bytes, ratio, absolute and .. names, links,
// encryption. `bytes` must outlive it.
Result<std::unique_ptr<Bundle>> zip_bundle(std::span<const uint8_t> bytes);

// A file of a bundle that was uploaded file by file. Names are relative and without ".."
// (proto/bundle_manifest.h). The bytes must outlive the bundle.
struct BundledFile {
  std::string name;
  std::span<const uint8_t> bytes;
};
std::unique_ptr<Bundle> files_bundle(const std::vector<BundledFile>& files);

struct LoadOptions {
  bool decode_images = true;  // off: inspection needs only names
};

// Detects the format, opens a zip and chooses its mesh, parses, triangulates and decodes textures.
// A zip with several meshes is an error that lists them, unless `filename` has the form
// "bundle.zip!path/in/zip". A missing or broken texture or material file is a warning and an entry
// of missing_files. Errors: unsupported-media-type, malformed-mesh, empty-mesh,
// unsupported-feature, malformed-bundle.
Result<Scene> load_scene(std::string_view filename, std::span<const uint8_t> bytes,
                         const LoadOptions& options = {});

// Loads from files in a bundle, of which one is the mesh. filename: "name" or "name!mesh".
Result<Scene> load_scene(std::string_view filename, const Bundle& bundle,
                         const LoadOptions& options = {});

// Loaders, one per format. `bundle` resolves the files that the mesh names; `name` appears in
// errors.
Result<Scene> load_obj(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                       const LoadOptions& options);
Result<Scene> load_ply(std::string_view name, std::span<const uint8_t> bytes);
Result<Scene> load_stl(std::string_view name, std::span<const uint8_t> bytes);
Result<Scene> load_off(std::string_view name, std::span<const uint8_t> bytes);
// Loads an md5mesh in its bind pose.
Result<Scene> load_md5(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                       const LoadOptions& options);
// Loads glTF 2.0, as JSON or GLB.
Result<Scene> load_gltf(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                        const LoadOptions& options);

}  // namespace voxeld
