// Whether a device's 64-bit floats are the CPU's: a few thousand awkward vertices, moved and
// snapped by both.
#pragma once

#include <vector>

#include "server/gpu/context.h"
#include "server/grid/grid_spec.h"
#include "server/scene/skin_table.h"

namespace voxeld {

class SkinPass;

struct SkinSample {
  SkinTable table;
  Scene scene;  // parts that the table belongs to, without triangles
  Pose pose;
  GridSpec spec;
  glm::dmat4 world_from_file{1.0};
};

// Points per influence and per vertex, morphs or none, turned into the world or not. Half of the
// vertices stand as near to the planes between sub-voxels as doubles can; others where rules of
// the snap change, and outside of the grid. The same ones at all times.
std::vector<SkinSample> skin_samples();

// False where a q or a position differs (0 and -0 are equal). Errors: the driver's.
Result<bool> skins_exactly(const gpu::Context& context, SkinPass& pass);

}  // namespace voxeld
