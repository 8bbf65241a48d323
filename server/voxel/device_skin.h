// What a device offers to do of the vertices of an animation's frames.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "proto/options.h"
#include "proto/result.h"
#include "server/grid/grid_spec.h"
#include "server/scene/skin_table.h"
#include "server/voxel/tile_pipeline.h"

namespace voxeld {

// What all frames of a sequence have in common.
struct SkinnedFrames {
  const SkinTable& table;
  size_t triangle_count = 0;
  Rule rule = Rule::kTouch;
  Pipeline pipeline = Pipeline::kCompute;  // of their surface
};

struct SkinFrame {
  const SkinTable& table;
  const Pose& pose;
  GridSpec spec{};
  glm::dmat4 world_from_file{1.0};
  bool wants_positions = false;  // for read_positions()
  // Names the table among all that a process makes: what was uploaded of it under the same key
  // stays. SharedFrames::mesh_key().
  uint64_t key = 0;
};

// A TilePipeline that moves vertices to a pose and snaps them, into the memory that its passes read
// them from, with the bits of skin_vertices() and snap_scene(). Between two jobs of the pipeline;
// what it left serves the next one, whose plan says so (VoxelizePlan::has_device_vertices). One
// thread.
class DeviceSkin {
 public:
  virtual ~DeviceSkin() = default;

  // False where the CPU has to: another pipeline, buffers too small, arithmetic that is not the
  // CPU's, which the first question finds out. Errors: device-unavailable, internal with the
  // driver's words.
  virtual Result<bool> can_skin(const SkinnedFrames& frames) = 0;

  // False where the CPU has to: a vertex stands in no cell of the grid, or at no finite place.
  // Adds pass "skin" and the bytes that were uploaded to `stats`. Errors: as can_skin().
  virtual Result<bool> skin(const SkinFrame& frame, VoxelizeStats& stats) = 0;

  // Of the last skin(), from vertex `first` of the table on: q (SnappedMesh::vertices), and the
  // places that skin_vertices() gives.
  virtual void read_vertices(std::span<glm::ivec3> q) const = 0;
  virtual void read_positions(size_t first, std::span<glm::dvec3> positions) const = 0;
};

}  // namespace voxeld
