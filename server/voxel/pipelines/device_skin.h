// The interface by which a device moves the vertices of an animation's frames.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/grid/grid_spec.h"
#include "server/scene/core/skin_table.h"
#include "server/voxel/pipelines/tile_pipeline.h"

namespace voxeld {

// The properties that all frames of a sequence share.
struct SkinnedFrames {
  const SkinTable& table;
  size_t triangle_count = 0;
  Rule rule = Rule::kTouch;
  Pipeline pipeline = Pipeline::kCompute;  // makes the frames' surface
};

struct SkinFrame {
  const SkinTable& table;
  const Pose& pose;
  GridSpec spec{};
  glm::dmat4 world_from_file{1.0};
  bool wants_positions = false;  // for read_positions()
  // SharedFrames::mesh_key(): names the table uniquely in the process. Data that was uploaded under
  // the same key is used again.
  uint64_t key = 0;
};

// A TilePipeline that moves vertices to a pose and snaps them into the memory that its passes read.
// The result has the bits of skin_vertices() and snap_scene(). Called between two jobs of the
// pipeline: the result serves the next job, whose plan says so (VoxelizePlan::has_device_vertices).
// Not thread-safe.
class DeviceSkin {
 public:
  virtual ~DeviceSkin() = default;

  // False if the CPU must do it: the pipeline is another one, buffers are too small, or the
  // device's arithmetic differs from the CPU's. The first call tests the arithmetic. Errors:
  // device-unavailable, internal with the driver's words.
  virtual Result<bool> can_skin(const SkinnedFrames& frames) = 0;

  // False if the CPU must do it: a vertex is in no cell of the grid or not finite. Adds pass "skin"
  // and the uploaded bytes to `stats`. Errors: as can_skin().
  virtual Result<bool> skin(const SkinFrame& frame, VoxelizeStats& stats) = 0;

  // Read back the last skin(), from vertex `first` of the table on: q as in SnappedMesh::vertices,
  // and positions as skin_vertices() gives them.
  virtual void read_vertices(std::span<glm::ivec3> q) const = 0;
  virtual void read_positions(size_t first, std::span<glm::dvec3> positions) const = 0;
};

}  // namespace voxeld
