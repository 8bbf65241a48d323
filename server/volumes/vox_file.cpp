// Makes a grid of a MagicaVoxel file: vox_chunks.cpp reads it, vox_scene.cpp places its models.
//
// In the file z points up: cell (x, y, z) of the scene becomes (x, z, -1 - y) of the grid, which
// keeps handedness. The grid is the box of the models that are shown, moved to cell 0, with
// voxels of side 1. Files of voxeld's own (server/formats/vox.cpp) name dims, origin and voxel size
// in the attributes of the root, and the models' places follow from dims; where all models lie in
// that grid, these apply instead.
#include <algorithm>
#include <array>
#include <string>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/volumes/volume_error.h"
#include "server/volumes/volume_files.h"
#include "server/volumes/vox_chunks.h"
#include "server/volumes/vox_scene.h"
#include "server/volumes/voxel_list.h"

namespace voxeld::volumes {
namespace {

// Cells of the scene, z up, [min, max).
struct VoxBox {
  std::array<int64_t, 3> min{}, max{};

  bool contains(const VoxBox& other) const {
    for (size_t c = 0; c < 3; ++c) {
      if (other.min[c] < min[c] || other.max[c] > max[c]) return false;
    }
    return true;
  }
};

VoxBox vox_bounds(const VoxScene& scene) {
  if (scene.instances.empty()) return {{0, 0, 0}, {1, 1, 1}};
  VoxBox box{scene.instances.front().min, scene.instances.front().max};
  for (const VoxInstance& instance : scene.instances) {
    for (size_t c = 0; c < 3; ++c) {
      box.min[c] = std::min(box.min[c], instance.min[c]);
      box.max[c] = std::max(box.max[c], instance.max[c]);
    }
  }
  return box;
}

// The cells of a grid of voxeld's: centred in x and y, and on the floor.
VoxBox vox_grid_box(const VoxPlacement& placement) {
  const std::array<int32_t, 3> size = {placement.dims[0], placement.dims[2], placement.dims[1]};
  VoxBox box{{-(size[0] / 2), -(size[1] / 2), 0}, {}};
  for (size_t c = 0; c < 3; ++c) box.max[c] = box.min[c] + size[c];
  return box;
}

void add_vox_warnings(std::string_view name, const VoxFile& file, const VoxScene& scene,
                      std::vector<Warning>& warnings) {
  const auto warn = [&](std::string_view code, const std::string& what) {
    warnings.push_back({std::string(code), std::string(name) + ": " + what});
  };
  if (file.trailing_bytes > 0) {
    warn("trailing-bytes",
         std::to_string(file.trailing_bytes) + " bytes after the chunk MAIN were left out");
  }
  if (scene.hidden_count > 0) {
    warn("hidden-nodes", std::to_string(scene.hidden_count) + " hidden nodes were left out");
  }
  if (file.has_frames || (!scene.has_graph && file.models.size() > 1)) {
    warn("static-pose", "frames after the first are left out");
  }
}

// Adds the voxels of a model; `box`: the cells of the grid in the scene.
void add_vox_model(const VoxModel& model, const VoxInstance& instance, const VoxBox& box,
                   const std::array<uint32_t, 256>& values, VoxelList& list) {
  // Scene axes of the grid's x, y, z. The models' boxes lie in the grid, so 32 bits suffice.
  constexpr std::array<size_t, 3> kSceneAxis = {0, 2, 1};
  std::array<size_t, 3> axis{};
  std::array<int32_t, 3> sign{}, first{};
  for (size_t c = 0; c < 3; ++c) {
    const size_t from = kSceneAxis[c];
    axis[c] = instance.axis[from];
    const bool flips = c == 2;  // y of the scene points to the grid's back
    sign[c] = flips ? -instance.sign[from] : instance.sign[from];
    first[c] = static_cast<int32_t>(flips ? box.max[from] - 1 - instance.first[from]
                                          : instance.first[from] - box.min[from]);
  }
  const size_t count = model.voxels.size() / kVoxVoxelBytes;
  for (size_t i = 0; i < count; ++i) {
    if (i % kVoxCancelVoxels == 0) cancel_point();
    const uint8_t* voxel = &model.voxels[kVoxVoxelBytes * i];
    if (voxel[3] == 0) continue;
    list.add({first[0] + sign[0] * voxel[axis[0]], first[1] + sign[1] * voxel[axis[1]],
              first[2] + sign[2] * voxel[axis[2]]},
             values[voxel[3]]);
  }
}

Result<std::vector<SparseTile>> vox_tiles(std::string_view name, const VoxFile& file,
                                          const VoxScene& scene, const VoxBox& box,
                                          const ChannelSet& channels) {
  // Empty voxels (colour 0) count, too: the limit bounds the time that a file can ask for.
  uint64_t voxels = 0;
  for (const VoxInstance& instance : scene.instances) {
    voxels += file.models[instance.model].voxels.size() / kVoxVoxelBytes;
  }
  VOXELD_TRY(check_volume_voxels(name, voxels));
  VoxelList list;
  std::array<uint32_t, 256> values{};
  for (size_t i = 0; i < values.size(); ++i) {
    VoxelValues value;
    value.color = file.colors[i];
    values[i] = list.add_values(value);
  }
  for (const VoxInstance& instance : scene.instances) {
    add_vox_model(file.models[instance.model], instance, box, values, list);
  }
  return list.finish(channels);
}

}  // namespace

Result<Volume> read_vox(std::string_view name, std::span<const uint8_t> bytes) {
  VOXELD_ASSIGN(const VoxFile file, read_vox_chunks(name, bytes));
  VOXELD_ASSIGN(const VoxScene scene, place_vox_models(name, file));
  Volume volume;
  add_vox_warnings(name, file, scene, volume.warnings);
  VoxBox box = vox_bounds(scene);
  GridSpec& spec = volume.grid.spec;
  if (file.placement) {
    const VoxPlacement& placement = *file.placement;
    const VoxBox grid_box = vox_grid_box(placement);
    if (scene.instances.empty() || grid_box.contains(box)) {
      box = grid_box;
      spec.origin_world = {placement.origin[0], placement.origin[1], placement.origin[2]};
      spec.voxel_size = {placement.voxel_size[0], placement.voxel_size[1], placement.voxel_size[2]};
    } else {
      volume.warnings.push_back(
          {"ignored-placement", std::string(name) +
                                    ": models lie outside of the grid that the root node names; "
                                    "its origin and voxel size are left out"});
    }
  }
  const std::array<int64_t, 3> dims = {box.max[0] - box.min[0], box.max[2] - box.min[2],
                                       box.max[1] - box.min[1]};
  VOXELD_TRY(check_volume_dims(name, dims));
  for (int c = 0; c < 3; ++c) spec.dims[c] = static_cast<int>(dims[static_cast<size_t>(c)]);
  volume.grid.channels = {.color = true};
  VOXELD_ASSIGN(volume.grid.tiles, vox_tiles(name, file, scene, box, volume.grid.channels));
  return volume;
}

}  // namespace voxeld::volumes
