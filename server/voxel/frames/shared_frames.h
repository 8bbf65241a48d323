// State that the frames of one scene share, from one Voxelizer::voxelize() to the next. Between
// frames only vertices move.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "server/grid/grid_spec.h"
#include "server/scene/core/skin_table.h"
#include "server/voxel/attributes/attribute_records.h"
#include "server/voxel/estimates/estimate.h"
#include "server/voxel/pipelines/choose.h"

namespace voxeld {

// The data that moves a frame's vertices. All of it must outlive the voxelizing of the frame.
struct PosedScene {
  const SkinTable* table = nullptr;
  const Pose* pose = nullptr;
  Scene* scene = nullptr;  // the scene that is voxelized
  bool is_moved = false;   // its vertices are already moved
};

// State for calls with one scene and the same options, between which only positions and normals
// change. A frame's grid has the same bytes as without it. Not thread-safe.
class SharedFrames {
 public:
  // spec: the place of every frame's grid. It replaces the request's placement, which would differ
  // by frame.
  explicit SharedFrames(const GridSpec& spec);

  const GridSpec& spec() const { return spec_; }
  // Computed once, because the test for transparency reads all texels.
  const WantedChannels& channels(const Scene& scene, const VoxelizeOptions& options);

  // Set before each frame if the pose behind its vertices is known. All frames have the same table.
  void set_pose(const PosedScene& posed) { posed_ = posed; }
  const std::optional<PosedScene>& posed() const { return posed_; }
  // True if a device is expected to move the next frame's vertices, so that the CPU need not. False
  // until a frame has been voxelized.
  bool device_moves() const { return device_moves_; }
  void set_device_moves(bool moves) { device_moves_ = moves; }
  // Moves the vertices on the CPU unless they are already moved. Errors: those of skin_vertices().
  Status move_vertices();

  // The pipeline of the last frame that was planned on the CPU. Frames that a device plans use it
  // too.
  struct Choice {
    PipelineDecision decision;
    Workload work;
  };
  const std::optional<Choice>& choice() const { return choice_; }
  void set_choice(Choice choice) { choice_ = std::move(choice); }

  // The previous frame's mesh, for its memory and for triangles that are still valid.
  SnappedMesh take_mesh() { return std::exchange(mesh_, {}); }
  void keep_mesh(SnappedMesh mesh) { mesh_ = std::move(mesh); }
  // Names the scene's triangles and skinning uniquely in the process. Never 0.
  uint64_t mesh_key() const { return mesh_key_; }

  // Flat colours of triangles, filled in as frames need them.
  FlatColors& flat_colors() { return flat_colors_; }
  // Unites the levels that a frame samples with those of earlier frames; both sets become the
  // union.
  void unite_levels(std::vector<ImageLevels>& of_frame);
  // Names the scene's images at these levels uniquely in the process. Pipelines keep their textures
  // while this key stays the same. Never 0.
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
