// The meshes of the self-test.
#pragma once

#include <vector>

#include "server/scene/core/scene.h"

namespace voxeld {

// The same closed mesh of small and large triangles, in a box from 0 to (300, 48, 48), with each
// kind of colour that has shaders of its own: opaque, translucent, textured, and textured and
// translucent. `format` says which. Deterministic.
std::vector<Scene> self_test_scenes();

}  // namespace voxeld
