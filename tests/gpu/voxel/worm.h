// A textured tube that bends and breathes: a scene, what its vertices follow, and its poses.
#pragma once

#include "server/scene/core/scene.h"
#include "server/scene/core/skin_table.h"

namespace voxeld::pipelines {

struct Worm {
  Scene scene;  // the bind pose: a tube along y, 2 wide and 10 long, and a plate below it
  SkinTable table;

  // is_md5: points per influence, of rigid joints. Else points per vertex, of which the ones in the
  // middle have morphs, too.
  explicit Worm(bool is_md5, int rings = 24);
  // One cycle is 12 frames. Vertices stay within [-12, 12].
  Pose pose(int frame) const;
};

}  // namespace voxeld::pipelines
