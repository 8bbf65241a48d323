// GLSL built-ins for shader libraries that are compiled as C++.
#pragma once

#include <cstdint>

#include <glm/common.hpp>
#include <glm/gtc/type_precision.hpp>
#include <glm/integer.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "shaders/shared/attributes.h"

namespace voxeld::glsl {
using glm::abs;
using glm::bitCount;
using glm::ceil;
using glm::clamp;
using glm::findMSB;
using glm::floor;
using glm::i64vec3;
using glm::ivec2;
using glm::ivec3;
using glm::max;
using glm::min;
using glm::uint;
using glm::uvec3;
using std::int64_t;

// The high word of a product. For GLSL, lib/touch_int.glsl defines it.
inline uint umul_high(uint a, uint b) {
  return static_cast<uint>(uint64_t{a} * b >> 32);
}
}  // namespace voxeld::glsl
