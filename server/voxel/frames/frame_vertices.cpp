#include "server/voxel/frames/frame_vertices.h"

#include "server/base/check.h"
#include "server/base/clock.h"

namespace voxeld {
namespace {

// True if only the surface is wanted. Fills and distances need the mesh on the CPU.
bool is_surface(const VoxelizePlan& plan) {
  return plan.options.fill == Fill::kSurface && !plan.channels.grid.distance;
}

void read_positions(const DeviceSkin& device, const SkinTable& table, Scene& scene) {
  for (size_t p = 0; p < scene.parts.size(); ++p) {
    device.read_positions(table.part_first_vertex[p], scene.parts[p].positions);
  }
}

}  // namespace

Result<bool> may_skin_frames(DeviceSkin* device, const SharedFrames& frames,
                             const VoxelizePlan& plan, Pipeline pipeline) {
  // A mesh that is not whole has left the grid or is split. The next frame's usually is too.
  if (device == nullptr || !frames.posed() || !plan.mesh.is_whole || !is_surface(plan) ||
      plan.channels.summed.normal) {
    return false;
  }
  return device->can_skin(
      {*frames.posed()->table, plan.mesh.triangles.size(), plan.options.rule, pipeline});
}

Result<bool> skin_frame(DeviceSkin* device, const SharedFrames& frames, bool wants_vertices,
                        VoxelizePlan& plan, VoxelizeStats& stats) {
  const auto& posed = frames.posed();
  if (!frames.device_moves() || !posed || posed->is_moved || !plan.mesh.is_whole) return false;
  VOXELD_CHECK(device != nullptr && posed->scene == &plan.scene, "frames of another scene");
  const SkinTable& table = *posed->table;
  const bool has_attributes = plan.channels.any();
  VOXELD_ASSIGN(const bool stands_in_cells,
                device->skin({table, *posed->pose, plan.spec, plan.world_from_file, has_attributes,
                              frames.mesh_key()},
                             stats));
  if (!stands_in_cells) return false;
  Stopwatch watch;
  const bool reads = wants_vertices || has_attributes;
  // The vertices are still the previous frame's. They are cleared if none are read, so that nothing
  // can take them for this frame's.
  plan.mesh.vertices.resize(reads ? table.vertex_count() : 0);
  if (reads) device->read_vertices(plan.mesh.vertices);
  if (has_attributes) read_positions(*device, table, *posed->scene);
  if (reads) add_stage(stats.passes, "read", watch.lap());
  return true;
}

}  // namespace voxeld
