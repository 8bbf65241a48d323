// Loads a scene: detects the format, chooses the file of a zip, and calls the loader.
#include "server/scene/load.h"

#include <algorithm>
#include <utility>

#include "proto/text/text_file.h"
#include "server/scene/core/animated_scene.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/ply/ply.h"

namespace voxeld {
namespace {

constexpr size_t kListedNamesMax = 20;

// Only glTF has variants of materials.
Status check_variant(MeshFormat format, const LoadOptions& options) {
  if (!options.variant || format == MeshFormat::kGltf || format == MeshFormat::kGlb) return {};
  return Error{ErrorCode::kInvalidOption, "variant: the file has no variants of materials",
               "gltf or glb", std::string(mesh_format_name(format))};
}

Result<Scene> load_format(MeshFormat format, std::string_view name, std::span<const uint8_t> bytes,
                          const Bundle& bundle, const LoadOptions& options) {
  VOXELD_TRY(check_variant(format, options));
  switch (format) {
    case MeshFormat::kObj:
      return load_obj(name, bytes, bundle, options);
    case MeshFormat::kPly:
      return load_ply(name, bytes, bundle, options);
    case MeshFormat::kStl:
      return load_stl(name, bytes);
    case MeshFormat::kOff:
      return load_off(name, bytes);
    case MeshFormat::kGltf:
    case MeshFormat::kGlb:
      return load_gltf(name, bytes, bundle, options);
    case MeshFormat::kMd5:
      return load_md5(name, bytes, bundle, options);
    case MeshFormat::k3mf:
      return load_3mf(name, bytes, bundle, options);
    case MeshFormat::kZip:
      break;
  }
  return Error{ErrorCode::kMalformedBundle, std::string(name) + ": a zip inside a zip", "a mesh",
               "a zip"};
}

// Whether the name is that of a 3MF package, which is a zip.
bool is_package(std::string_view name) {
  constexpr std::string_view kExtension = ".3mf";
  return name.size() > kExtension.size() &&
         equals_ignoring_case(name.substr(name.size() - kExtension.size()), kExtension);
}

// Whether the name is that of a mesh file, and not one that macOS or an editor left behind.
bool is_mesh_entry(std::string_view name, bool wants_package) {
  for (size_t begin = 0; begin < name.size();) {
    const size_t end = std::min(name.find('/', begin), name.size());
    const std::string_view part = name.substr(begin, end - begin);
    if (part.front() == '.' || part == "__MACOSX") return false;
    begin = end + 1;
  }
  const auto format = detect_format(name, {});
  return format &&
         (*format == MeshFormat::kZip ? wants_package && is_package(name) : !wants_package);
}

std::string listed(const std::vector<std::string>& names) {
  std::string list;
  for (size_t i = 0; i < names.size() && i < kListedNamesMax; ++i) {
    list.append(i == 0 ? "" : ", ").append(names[i]);
  }
  if (names.size() > kListedNamesMax) {
    list += " and " + std::to_string(names.size() - kListedNamesMax) + " more";
  }
  return list;
}

std::vector<std::string> names_of(const Bundle& bundle, bool meshes_only) {
  std::vector<std::string> names;
  for (const Bundle::Entry& entry : bundle.entries()) {
    if (!meshes_only || is_mesh_entry(entry.name, false)) names.push_back(entry.name);
  }
  // Downloads often have a model as STL and as 3MF, so packages count where nothing else is there.
  if (!names.empty() || !meshes_only) return names;
  for (const Bundle::Entry& entry : bundle.entries()) {
    if (is_mesh_entry(entry.name, true)) names.push_back(entry.name);
  }
  return names;
}

// The mesh of a zip or bundle: the one that `member` names, or the only one. `kind` is "zip" or the
// like, for errors.
Result<std::string> choose_mesh(std::string_view zip_name, std::string_view member,
                                std::string_view kind, const Bundle& bundle) {
  const std::string in_it = " in the " + std::string(kind);
  const std::vector<std::string> all = names_of(bundle, false);
  std::optional<std::string> package_model;
  if (member.empty()) {
    VOXELD_ASSIGN(package_model, find_3mf_model(bundle));
    if (package_model) member = *package_model;
  }
  if (!member.empty()) {
    const auto found = bundle.resolve(member, "");
    if (found) return all[found->index];
    return Error{ErrorCode::kMalformedBundle,
                 std::string(zip_name) + ": no file " + shown(member) + in_it, "one of its files",
                 listed(all)};
  }
  const std::vector<std::string> meshes = names_of(bundle, true);
  if (meshes.size() == 1) return meshes[0];
  if (meshes.empty()) {
    return Error{ErrorCode::kMalformedBundle, std::string(zip_name) + ": no mesh" + in_it,
                 "one obj, ply, stl, off, gltf, glb or md5mesh file",
                 all.empty() ? "no files" : listed(all)};
  }
  return Error{ErrorCode::kMalformedBundle, std::string(zip_name) + ": several meshes" + in_it,
               "one, or its choice by filename=" + std::string(zip_name) + "!" + meshes[0],
               listed(meshes)};
}

// Loads the scene, and its rig if the format has one.
Result<AnimatedScene> load_animated_format(MeshFormat format, std::string_view name,
                                           std::span<const uint8_t> bytes, const Bundle& bundle,
                                           const LoadOptions& options) {
  VOXELD_TRY(check_variant(format, options));
  if (format == MeshFormat::kMd5) return load_animated_md5(name, bytes, bundle, options);
  if (format == MeshFormat::kGltf || format == MeshFormat::kGlb) {
    return load_animated_gltf(name, bytes, bundle, options);
  }
  AnimatedScene animated;
  VOXELD_ASSIGN(animated.scene, load_format(format, name, bytes, bundle, options));
  return animated;
}

template <typename Loaded>
using FormatLoader = Result<Loaded> (*)(MeshFormat format, std::string_view name,
                                        std::span<const uint8_t> bytes, const Bundle& bundle,
                                        const LoadOptions& options);

template <typename Loaded>
Result<Loaded> load_bundle(std::string_view filename, std::string_view kind, const Bundle& bundle,
                           const LoadOptions& options, FormatLoader<Loaded> load) {
  const size_t mark = filename.find('!');
  const std::string_view zip_name = filename.substr(0, mark);
  const std::string_view member =
      mark == filename.npos ? std::string_view() : filename.substr(mark + 1);
  VOXELD_ASSIGN(const std::string name, choose_mesh(zip_name, member, kind, bundle));
  VOXELD_ASSIGN(const std::optional<std::vector<uint8_t>> mesh, bundle.find(name, ""));
  if (!mesh) return Error{ErrorCode::kInternal, name + ": lost in the bundle", "", ""};
  VOXELD_ASSIGN(const MeshFormat format, detect_format(name, *mesh));
  if (format == MeshFormat::kZip && is_package(name)) {
    VOXELD_ASSIGN(const std::unique_ptr<Bundle> package, zip_bundle(*mesh));
    VOXELD_ASSIGN(const auto model_name, find_3mf_model(*package));
    VOXELD_ASSIGN(const auto model, package->find(model_name.value_or(""), ""));
    if (model) return load(MeshFormat::k3mf, *model_name, *model, *package, options);
  }
  return load(format, name, *mesh, bundle, options);
}

template <typename Loaded>
Result<Loaded> load_file(std::string_view filename, std::span<const uint8_t> bytes,
                         const LoadOptions& options, FormatLoader<Loaded> load) {
  VOXELD_ASSIGN(const MeshFormat format, detect_format(filename, bytes));
  if (format == MeshFormat::kZip) {
    VOXELD_ASSIGN(const std::unique_ptr<Bundle> zip, zip_bundle(bytes));
    return load_bundle<Loaded>(filename, "zip", *zip, options, load);
  }
  const std::unique_ptr<Bundle> bundle = single_file_bundle(std::string(filename), bytes);
  return load(format, filename, bytes, *bundle, options);
}

}  // namespace

Result<Scene> load_scene(std::string_view filename, std::span<const uint8_t> bytes,
                         const LoadOptions& options) {
  return load_file<Scene>(filename, bytes, options, load_format);
}

Result<Scene> load_scene(std::string_view filename, const Bundle& bundle,
                         const LoadOptions& options) {
  return load_bundle<Scene>(filename, "bundle", bundle, options, load_format);
}

Result<AnimatedScene> load_animated_scene(std::string_view filename, const Bundle& bundle,
                                          const LoadOptions& options) {
  return load_bundle<AnimatedScene>(filename, "bundle", bundle, options, load_animated_format);
}

Result<AnimatedScene> load_animated_scene(std::string_view filename, std::span<const uint8_t> bytes,
                                          const LoadOptions& options) {
  return load_file<AnimatedScene>(filename, bytes, options, load_animated_format);
}

}  // namespace voxeld
