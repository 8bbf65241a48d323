#include "server/worker/task/asset_input.h"

#include <string_view>
#include <utility>
#include <vector>

#include "proto/messages/bundle_manifest.h"
#include "server/base/disk/file.h"
#include "server/scene/load.h"

namespace voxeld {
namespace {

size_t scene_bytes(const Scene& scene) {
  size_t bytes = 0;
  for (const MeshPart& part : scene.parts) {
    bytes += part.positions.size() * sizeof(part.positions[0]) +
             part.normals.size() * sizeof(part.normals[0]) + part.uvs.size() * sizeof(part.uvs[0]) +
             part.colors.size() * sizeof(part.colors[0]) +
             part.indices.size() * sizeof(part.indices[0]);
  }
  for (const Image& image : scene.images) bytes += image.rgba.size();
  return bytes;
}

size_t skin_bytes(const SkinTable& skin) {
  return skin.first_influence.size() * sizeof(uint32_t) +
         skin.influences.size() * sizeof(Influence) + skin.morphs.size() * sizeof(MorphDelta) +
         skin.points.size() * sizeof(skin.points[0]) +
         skin.normals.size() * sizeof(skin.normals[0]);
}

// The files of a bundle that was uploaded file by file.
struct MappedBundle {
  std::vector<MappedFile> files;
  std::unique_ptr<Bundle> bundle;
};

Result<MappedBundle> map_bundle(const Task& task) {
  VOXELD_ASSIGN(const std::vector<uint8_t> manifest, read_file(task.input_path));
  VOXELD_ASSIGN(
      const std::vector<BundleFile> named,
      parse_bundle_manifest({reinterpret_cast<const char*>(manifest.data()), manifest.size()}));
  if (named.size() != task.bundle_paths.size()) {
    return Error{ErrorCode::kInternal, "the bundle's files are not those of its manifest",
                 std::to_string(named.size()) + " files", std::to_string(task.bundle_paths.size())};
  }
  MappedBundle mapped;
  std::vector<BundledFile> files;
  for (size_t i = 0; i < named.size(); ++i) {
    VOXELD_ASSIGN(MappedFile file, MappedFile::open(task.bundle_paths[i]));
    mapped.files.push_back(std::move(file));
    files.push_back({named[i].name, mapped.files.back().bytes()});
  }
  mapped.bundle = files_bundle(files);
  return mapped;
}

// Calls load(filename, bytes or bundle, options) on the task's input.
template <typename Load>
auto load_task(const Task& task, const LoadOptions& options, const Load& load)
    -> decltype(load(std::string_view(), std::span<const uint8_t>(), LoadOptions())) {
  if (!task.bundle_paths.empty()) {
    VOXELD_ASSIGN(const MappedBundle mapped, map_bundle(task));
    return load(task.filename, *mapped.bundle, options);
  }
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(task.input_path));
  return load(task.filename, file.bytes(), options);
}

Result<AnimatedScene> load_still(const Task& task, const LoadOptions& wanted) {
  AnimatedScene still;
  VOXELD_ASSIGN(still.scene,
                load_task(task, wanted,
                          [](std::string_view name, const auto& from, const LoadOptions& options) {
                            return load_scene(name, from, options);
                          }));
  return still;
}

Result<AnimatedScene> load_moving(const Task& task, const LoadOptions& wanted) {
  return load_task(task, wanted,
                   [](std::string_view name, const auto& from, const LoadOptions& options) {
                     return load_animated_scene(name, from, options);
                   });
}

// Loads the input, with its rig if `moves`. The cache holds one scene for both cases, because a
// moving one contains the static one.
Result<std::shared_ptr<const AnimatedScene>> load_input(TaskRun& run, const LoadOptions& options,
                                                        bool moves) {
  const StageTimer stage(run, "parse");
  InputCache& cache = run.engine.cache;
  const std::string still_key = scene_key(run.task, options.decode_images) +
                                (options.variant ? " variant " + *options.variant : "");
  const std::string moving_key = still_key + " moving";
  const bool is_cached = cache.scene != nullptr && (cache.scene_key == moving_key ||
                                                    (!moves && cache.scene_key == still_key));
  if (!is_cached) {
    cache.scene.reset();  // freed before the next one is loaded: both may not fit into memory
    VOXELD_ASSIGN(AnimatedScene loaded,
                  moves ? load_moving(run.task, options) : load_still(run.task, options));
    cache.scene = std::make_shared<const AnimatedScene>(std::move(loaded));
    cache.scene_key = moves ? moving_key : still_key;
  }
  std::shared_ptr<const AnimatedScene> scene = cache.scene;
  if (scene_bytes(scene->scene) + skin_bytes(scene->skin) > kCachedSceneBytesMax) {
    cache.scene.reset();
  }
  add_warnings(run, scene->scene.warnings);
  VOXELD_TRY(run.monitor.check());
  return scene;
}

}  // namespace

std::string scene_key(const Task& task, bool decode_images) {
  // The key has the whole name, because the scene's warnings contain it.
  return task.input_hash + (decode_images ? " images " : " names ") + task.filename;
}

Result<std::shared_ptr<const Scene>> load_input_scene(TaskRun& run, const LoadOptions& options) {
  VOXELD_ASSIGN(const auto animated, load_input(run, options, false));
  return std::shared_ptr<const Scene>(animated, &animated->scene);
}

Result<std::shared_ptr<const AnimatedScene>> load_input_animated(TaskRun& run,
                                                                 const LoadOptions& options) {
  return load_input(run, options, true);
}

LoadOptions load_options(const VoxelizeOptions& options) {
  return {.decode_images = true, .variant = options.variant};
}

}  // namespace voxeld
