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
#include "server/scene/core/loaders.h"
#include "server/scene/core/scene.h"

namespace voxeld {

enum class MeshFormat { kObj, kPly, kStl, kOff, kGltf, kGlb, kMd5, k3mf, kZip };

// Detects the format by the file name's extension, else by the first bytes. Errors:
// unsupported-media-type, naming the formats that are read.
Result<MeshFormat> detect_format(std::string_view filename, std::span<const uint8_t> bytes);
std::string_view mesh_format_name(MeshFormat format);

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

// Loads a file as load_scene() does. All md5anim files of a zip belong to its md5mesh, in the order
// of the zip. Each stands alone: one that is broken or does not fit is listed as unusable, with the
// warning "ignored-animation". Errors: those of load_scene(); malformed-mesh for a broken animation
// of a glTF document, naming its place there.
Result<AnimatedScene> load_animated_scene(std::string_view filename, std::span<const uint8_t> bytes,
                                          const LoadOptions& options = {});

Result<AnimatedScene> load_animated_scene(std::string_view filename, const Bundle& bundle,
                                          const LoadOptions& options = {});

}  // namespace voxeld
