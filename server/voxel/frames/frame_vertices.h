// Decides whether a device or the CPU moves the vertices of an animation's frames. The passes of a
// device find vertices that it moved without the CPU.
#pragma once

#include "server/voxel/frames/shared_frames.h"
#include "server/voxel/pipelines/device_skin.h"

namespace voxeld {

// Whether `device` (may be null) can move the vertices of the frames after this one. This frame's
// mesh is in the plan, and `pipeline` made its surface. Positions may be needed for attributes and
// are read back. Normals rule the device out, because it does not move them. Errors: those of
// can_skin().
Result<bool> may_skin_frames(DeviceSkin* device, const SharedFrames& frames,
                             const VoxelizePlan& plan, Pipeline pipeline);

// Moves this frame's vertices on the device if that is allowed (SharedFrames::device_moves()) and
// the CPU has not moved them already. The plan's mesh is the previous frame's, whose triangles
// stay. Vertices are read back if `wants_vertices`, positions into the scene if the plan has
// attributes. False if the CPU must move them. Errors: those of DeviceSkin::skin().
Result<bool> skin_frame(DeviceSkin* device, const SharedFrames& frames, bool wants_vertices,
                        VoxelizePlan& plan, VoxelizeStats& stats);

}  // namespace voxeld
