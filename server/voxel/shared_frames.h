// What the frames of one scene have in common, from one call of Voxelizer::voxelize() to the next:
// vertices move, everything else stays.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "server/grid/grid_spec.h"
#include "server/scene/skin_table.h"
#include "server/voxel/attribute_records.h"
#include "server/voxel/choose.h"
#include "server/voxel/estimate.h"

namespace voxeld {

// What moves a frame's vertices; all must outlive the voxelizing of the frame.
struct PosedScene {
  const SkinTable* table = nullptr;
  const Pose* pose = nullptr;
  Scene* scene = nullptr;  // the one that is voxelized
  bool is_moved = false;   // its vertices stand there already
};

// For calls with one scene, of which positions and normals alone change, and the same options. A
// frame's grid has the bytes that it would have without it. One thread.
class SharedFrames {
 public:
  // Where all grids lie, in place of what the request's placement gives for each.
  explicit SharedFrames(const GridSpec& spec);

  const GridSpec& spec() const { return spec_; }
  // Looked up once: whether anything is transparent takes a look at all texels.
  const WantedChannels& channels(const Scene& scene, const VoxelizeOptions& options);

  // Before each frame, where more than its vertices is known. The table is that of all frames.
  void set_pose(const PosedScene& posed) { posed_ = posed; }
  const std::optional<PosedScene>& posed() const { return posed_; }
  // Whether the vertices of the next frame are expected to be moved by a device, and the CPU need
  // not move them before. False until a frame has been voxelized.
  bool device_moves() const { return device_moves_; }
  void set_device_moves(bool moves) { device_moves_ = moves; }
  // Moves the vertices by the CPU, where they are not moved yet. Errors: those of skin_vertices().
  Status move_vertices();

  // Of the last frame that was planned on the CPU. Those that a device plans follow it.
  struct Choice {
    PipelineDecision decision;
    Workload work;
  };
  const std::optional<Choice>& choice() const { return choice_; }
  void set_choice(Choice choice) { choice_ = std::move(choice); }

  // The mesh of the frame before, for its memory and for triangles that are still right.
  SnappedMesh take_mesh() { return std::exchange(mesh_, {}); }
  void keep_mesh(SnappedMesh mesh) { mesh_ = std::move(mesh); }
  // Names the scene's triangles, and what its vertices follow, among all that a process makes.
  // Never 0.
  uint64_t mesh_key() const { return mesh_key_; }

  // Colours of triangles, as frames find them.
  FlatColors& flat_colors() { return flat_colors_; }
  // Adds the levels that a frame samples to those of the frames before it, in both places.
  void unite_levels(std::vector<ImageLevels>& of_frame);
  // Names the scene's images at these levels, among all that a process makes: pipelines keep what
  // they made of them as long as it stays the same. Never 0.
  uint64_t textures_key() const { return textures_key_; }

 private:
  GridSpec spec_;
  std::optional<WantedChannels> channels_;
  std::optional<PosedScene> posed_;
  std::optional<Choice> choice_;
  bool device_moves_ = false;
  SnappedMesh mesh_;
  FlatColors flat_colors_;
  std::vector<ImageLevels> levels_;
  uint64_t mesh_key_, textures_key_;
};

}  // namespace voxeld
