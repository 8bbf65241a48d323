// A closed mesh of any size: a sphere with waves.
#pragma once

#include "server/scene/core/scene.h"

namespace voxeld {

// 20 * 4^levels triangles, counter-clockwise from outside.
Scene wavy_sphere(int levels);

}  // namespace voxeld
