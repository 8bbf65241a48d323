// Who moves the vertices of an animation's frames: a device, where its passes then find them
// without the CPU, or the CPU.
#pragma once

#include "server/voxel/device_skin.h"
#include "server/voxel/shared_frames.h"

namespace voxeld {

// Whether `device` (null: there is none) may move the vertices of the frames after this one, whose
// mesh stands in the plan and whose surface `pipeline` made. Attributes may need positions, which
// are read back, but not normals, which the device does not move. Errors: those of can_skin().
Result<bool> may_skin_frames(DeviceSkin* device, const SharedFrames& frames,
                             const VoxelizePlan& plan, Pipeline pipeline);

// Has the device move this frame's vertices, where it may (SharedFrames::device_moves()) and the
// CPU has not done it before; the plan's mesh is the one before, whose triangles stay. Vertices are
// read back where they are wanted, positions into the scene where the plan has attributes. False:
// the CPU has to. Errors: those of DeviceSkin::skin().
Result<bool> skin_frame(DeviceSkin* device, const SharedFrames& frames, bool wants_vertices,
                        VoxelizePlan& plan, VoxelizeStats& stats);

}  // namespace voxeld
