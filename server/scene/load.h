// From the bytes of an upload to a Scene. No file system: everything comes out of the upload.
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

// By the file name's extension, else by the first bytes. Errors: unsupported-media-type, naming the
// formats that are read.
Result<MeshFormat> detect_format(std::string_view filename, std::span<const uint8_t> bytes);
std::string_view mesh_format_name(MeshFormat format);

// The files of one upload: a single mesh, or a zip with a mesh, its textures, buffers and material
// files; or the files of several uploads. Names are found as written, then case-insensitively, then
// by base name, with backslashes taken as slashes; nothing outside the upload is ever opened.
class Bundle {
 public:
  virtual ~Bundle() = default;
  struct Entry {
    std::string name;
    int64_t bytes = 0;
  };
  virtual const std::vector<Entry>& entries() const = 0;
  // Bytes of the file that `reference` means, seen from the file `from` ("models/a.obj"); nullopt
  // where the bundle has none. Errors: malformed-bundle (broken entry, over a cap).
  virtual Result<std::optional<std::vector<uint8_t>>> find(std::string_view reference,
                                                           std::string_view from) const = 0;
};

// A bundle with only the mesh itself; `bytes` must outlive it.
std::unique_ptr<Bundle> single_file_bundle(std::string filename, std::span<const uint8_t> bytes);
// A zip, checked against limits.h: entries, inflated bytes, ratio, absolute and .. names, links,
// encryption. `bytes` must outlive it.
Result<std::unique_ptr<Bundle>> zip_bundle(std::span<const uint8_t> bytes);

// Files that were uploaded one by one. Names are relative and without ".."
// (proto/bundle_manifest.h). The bytes must outlive it.
struct BundledFile {
  std::string name;
  std::span<const uint8_t> bytes;
};
std::unique_ptr<Bundle> files_bundle(const std::vector<BundledFile>& files);

struct LoadOptions {
  bool decode_images = true;  // off: inspection needs names alone
};

// The whole way: detect the format, open a zip and choose its mesh (the only one; several are an
// error that lists them unless `filename` has the form "bundle.zip!path/in/zip"), parse,
// triangulate, decode textures. Errors: unsupported-media-type, malformed-mesh, empty-mesh,
// unsupported-feature, malformed-bundle. A texture or material file that is missing or broken is a
// warning and an entry of missing_files.
Result<Scene> load_scene(std::string_view filename, std::span<const uint8_t> bytes,
                         const LoadOptions& options = {});

// The same of files that are there already, of which one is the mesh; filename: "name" or
// "name!mesh".
Result<Scene> load_scene(std::string_view filename, const Bundle& bundle,
                         const LoadOptions& options = {});

// One loader per format; `bundle` resolves the files that it names. `name` stands in errors.
Result<Scene> load_obj(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                       const LoadOptions& options);
Result<Scene> load_ply(std::string_view name, std::span<const uint8_t> bytes);
Result<Scene> load_stl(std::string_view name, std::span<const uint8_t> bytes);
Result<Scene> load_off(std::string_view name, std::span<const uint8_t> bytes);
// md5mesh, in its bind pose.
Result<Scene> load_md5(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                       const LoadOptions& options);
// glTF 2.0, as JSON or GLB.
Result<Scene> load_gltf(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                        const LoadOptions& options);

}  // namespace voxeld
