#include "server/scene/core/normals.h"

#include <gtest/gtest.h>

#include <array>
#include <limits>

namespace voxeld {
namespace {

TEST(Normals, directions_have_unit_length_however_small_or_large_the_vector) {
  const glm::dvec3 towards(0.36, -0.48, 0.8);
  for (const double size :
       {5e-324, 1e-320, 1e-300, 1e-160, 1e-141, 1e-3, 1.0, 1e139, 1e200, 1.7e308}) {
    const glm::vec3 n = direction_of(towards * size);
    EXPECT_NEAR(glm::length(n), 1.0f, 1e-6f) << size;
    if (size < 1e-310) continue;  // its digits are gone
    EXPECT_LT(glm::length(n - glm::vec3(towards)), 1e-6f) << size;
  }
}

TEST(Normals, a_vector_without_direction_becomes_zero) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const glm::dvec3& v : {glm::dvec3(0.0), glm::dvec3(1, kNan, 1), glm::dvec3(kNan, 1e200, 0),
                              glm::dvec3(0, 0, kInfinity), glm::dvec3(-kInfinity, 1, kNan)}) {
    EXPECT_EQ(direction_of(v), glm::vec3(0.0f));
  }
}

TEST(Normals, vanished_ones_become_that_of_a_triangle_also_of_a_tiny_one) {
  for (const double size : {1.0, 1e-80, 1e-160}) {
    const std::array<glm::dvec3, 3> positions = {glm::dvec3(0.0), glm::dvec3(size, 0, 0),
                                                 glm::dvec3(0, 0, size)};
    const std::array<uint32_t, 3> indices = {0, 1, 2};
    std::array<glm::vec3, 3> normals = {glm::vec3(0.0f), glm::vec3(1, 0, 0), glm::vec3(0.0f)};
    repair_normals(positions, indices, normals);
    EXPECT_EQ(normals[0], glm::vec3(0, -1, 0)) << size;
    EXPECT_EQ(normals[1], glm::vec3(1, 0, 0)) << size;
  }
}

TEST(Normals, triangles_without_one_give_up) {
  const std::array<glm::dvec3, 3> positions = {glm::dvec3(1.0), glm::dvec3(1.0), glm::dvec3(2.0)};
  const std::array<uint32_t, 3> indices = {0, 1, 2};
  std::array<glm::vec3, 3> normals{};
  repair_normals(positions, indices, normals);
  EXPECT_EQ(normals[2], glm::vec3(0, 0, 1));
}

}  // namespace
}  // namespace voxeld
