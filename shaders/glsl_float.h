// GLSL built-ins for entry points that glsl_to_cpp.py turns into C++. In addition to glsl.h these
// are float vectors, matrices, and swizzles, which are written value->*xyz there.
#pragma once

#include <glm/exponential.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/packing.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec4.hpp>
#include <glm/vector_relational.hpp>

#include "shaders/glsl.h"

namespace voxeld::glsl {
using glm::all;
using glm::any;
using glm::bvec2;
using glm::bvec3;
using glm::bvec4;
using glm::cos;
using glm::cross;
using glm::dot;
using glm::dvec2;
using glm::dvec3;
using glm::dvec4;
using glm::equal;
using glm::exp;
using glm::exp2;
using glm::findLSB;
using glm::findMSB;
using glm::fract;
using glm::greaterThan;
using glm::greaterThanEqual;
using glm::inversesqrt;
using glm::ivec4;
using glm::length;
using glm::lessThan;
using glm::lessThanEqual;
using glm::log;
using glm::log2;
using glm::mat3;
using glm::mix;
using glm::mod;
using glm::normalize;
using glm::notEqual;
using glm::pow;
using glm::reflect;
using glm::round;
using glm::sign;
using glm::sin;
using glm::smoothstep;
using glm::sqrt;
using glm::step;
using glm::tan;
using glm::trunc;
using glm::unpackSnorm4x8;
using glm::unpackUnorm4x8;
using glm::uvec2;
using glm::uvec4;
using glm::vec2;
using glm::vec3;
using glm::vec4;

// A swizzle: the places of a vector's components.
template <int... kPlaces>
struct Swizzle {};

template <glm::length_t kSize, typename T, int... kPlaces>
constexpr glm::vec<sizeof...(kPlaces), T> operator->*(const glm::vec<kSize, T>& v,
                                                      Swizzle<kPlaces...>) {
  return {v[kPlaces]...};
}
}  // namespace voxeld::glsl
