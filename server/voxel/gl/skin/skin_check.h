// A check that a device's 64-bit floats have the CPU's bits: a few thousand awkward vertices, which
// both move and snap.
#pragma once

#include <vector>

#include "server/gpu/context.h"
#include "server/grid/grid_spec.h"
#include "server/scene/core/skin_table.h"

namespace voxeld {

class SkinPass;

struct SkinSample {
  SkinTable table;
  Scene scene;  // the parts that the table belongs to, without triangles
  Pose pose;
  GridSpec spec;
  glm::dmat4 world_from_file{1.0};
};

// Samples with points per influence and per vertex, with and without morphs, in the file's frame
// and in the world's. Half of the vertices are as near to the planes between sub-voxels as doubles
// allow. Others are where rules of the snap change, and outside the grid. Deterministic.
std::vector<SkinSample> skin_samples();

// False if a q or a position differs (0 and -0 are equal). Errors: the driver's.
Result<bool> skins_exactly(const gpu::Context& context, SkinPass& pass);

}  // namespace voxeld
