// Marches in lanes against the text of the shader, ray by ray: the same bits on every instruction
// set.
#include "server/render/cpu/kernels/march_kernel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>

#include "server/render/packed_grid.h"
#include "shaders/glsl_float.h"
#include "shaders/shared/raymarch.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

const PackedGrid* packed = nullptr;  // that the text reads

namespace text {
using namespace glsl;  // NOLINT(google-build-using-namespace)
using shared::uint;
// Each needs the names of those before.
// clang-format off
#include "shaders/raymarch/dda.glsl"
#include "shaders/raymarch/dda_brick.glsl"
#include "shaders/raymarch/march_tree.glsl"
#include "shaders/raymarch/march.glsl"
#include "shaders/raymarch/march_light.glsl"
// clang-format on
uint node_word(uint index) {
  return packed->nodes[index];
}
uint brick_word(uint index) {
  return packed->bricks[index];
}
}  // namespace text

using glm::ivec3;
using glm::vec3;
using glm::vec4;

// Voxels alone, in bricks and tiles, and full nodes among them.
Grid mixed_grid(uint32_t seed) {
  std::mt19937 random(seed);
  Grid grid = test::grid_of({600, 300, 70}, test::random_voxels(random, {600, 300, 70}, 9000), {});
  grid.tiles[0].full = {};
  SparseTile& far = grid.tiles.emplace_back();
  far.coord = {2, 1, 0};
  far.full = {{0, 2}};
  std::erase_if(grid.tiles, [](const SparseTile& tile) {
    return tile.coord == std::array<int32_t, 3>{2, 1, 0} && tile.full.empty();
  });
  normalize_tiles(grid);
  return grid;
}

struct Arguments {
  text::GridRay ray;
  ivec3 cell;
  float t_max;
  vec4 level_t;
  int steps;
};

Arguments random_arguments(std::mt19937& random, const text::MarchGrid& grid) {
  const auto uniform = [&](float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(random);
  };
  Arguments a{};
  for (int c = 0; c < 3; ++c) {
    a.cell[c] = std::uniform_int_distribution<int>(grid.low[c], grid.high[c] - 1)(random);
  }
  vec3 direction(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
  for (int c = 0; c < 3; ++c) {
    if (random() % 8 == 0) direction[c] = 0;
  }
  if (direction == vec3(0)) direction.y = -1;
  a.ray = text::dda_ray(a.cell, vec3(uniform(0, 1), uniform(0, 1), uniform(0, 1)), direction);
  a.t_max = random() % 2 == 0 ? 3.0e38f : uniform(0, 100);
  a.steps = random() % 8 == 0 ? static_cast<int>(random() % 4) : 512;
  switch (random() % 3) {
    case 0:
      a.level_t = vec4(3.0e38f);
      break;
    case 1:
      a.level_t = text::light_levels(static_cast<int>(random() % 6), 8.0f);
      break;
    default:
      a.level_t = vec4(uniform(-5, 60), uniform(0, 90), uniform(0, 90), uniform(0, 200));
  }
  return a;
}

class MarchKernels : public ::testing::TestWithParam<CpuIsa> {
 protected:
  void use(const Grid& grid) {
    packed_ = *pack_grid(grid);
    packed = &packed_;
    grid_ = {packed_.occupied_min, packed_.occupied_max, packed_.tile_dims};
    tables_.nodes = packed_.nodes.data();
    tables_.bricks = packed_.bricks.data();
    for (size_t c = 0; c < 3; ++c) {
      const auto axis = static_cast<int>(c);
      tables_.low[c] = grid_.low[axis];
      tables_.high[c] = grid_.high[axis];
      tables_.tile_dims[c] = grid_.tile_dims[axis];
    }
  }
  void add(const Arguments& a) {
    const auto at = static_cast<size_t>(rays_->count++);
    for (size_t c = 0; c < 3; ++c) {
      const auto axis = static_cast<int>(c);
      rays_->base[c][at] = a.ray.base[axis];
      rays_->cell[c][at] = a.cell[axis];
      rays_->origin[c][at] = a.ray.origin[axis];
      rays_->direction[c][at] = a.ray.direction[axis];
      rays_->inverse[c][at] = a.ray.inverse[axis];
    }
    for (size_t i = 0; i < 4; ++i) rays_->level_t[i][at] = a.level_t[static_cast<int>(i)];
    rays_->t_max[at] = a.t_max;
    rays_->steps_max[at] = a.steps;
  }

  PackedGrid packed_;
  text::MarchGrid grid_{};
  MarchTables tables_;
  std::unique_ptr<MarchRays> rays_ = std::make_unique<MarchRays>();
  const MarchKernel& kernel_ = march_kernel(GetParam());
};

TEST_P(MarchKernels, rays_hit_what_the_text_says) {
  std::mt19937 random(5);
  int hits = 0, misses = 0;
  for (const Grid& grid :
       {mixed_grid(1), mixed_grid(2), test::random_grid(3, {20, 9, 30}, 60, false, false)}) {
    use(grid);
    for (const int count : {0, 1, 7, 16, 17, 100, MarchRays::kMax}) {
      rays_->count = 0;
      std::vector<Arguments> all;
      for (int i = 0; i < count; ++i) {
        all.push_back(random_arguments(random, grid_));
        add(all.back());
      }
      kernel_.march(tables_, *rays_);
      for (size_t i = 0; i < all.size(); ++i) {
        const Arguments& a = all[i];
        const text::March met = text::march(grid_, a.ray, a.cell, a.t_max, a.level_t, a.steps);
        ASSERT_EQ(rays_->t[i] >= 0, met.hit) << i << " of " << count;
        if (!met.hit) {
          ++misses;
          continue;
        }
        ++hits;
        ASSERT_EQ(rays_->t[i], met.t) << i;
        ASSERT_EQ(ivec3(rays_->hit[0][i], rays_->hit[1][i], rays_->hit[2][i]), met.cell) << i;
        ASSERT_EQ(rays_->axis[i], met.axis) << i;
      }
    }
  }
  EXPECT_GT(hits, 300);
  EXPECT_GT(misses, 300);
}

TEST_P(MarchKernels, fans_are_the_rays_of_the_text) {
  std::mt19937 random(6);
  const auto uniform = [&](float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(random);
  };
  use(mixed_grid(1));
  for (int trial = 0; trial < 200; ++trial) {
    const vec3 axis =
        trial == 0 ? vec3(0, 1, 0)
                   : glm::normalize(vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1) + 1e-6f));
    const vec3 tangent = text::light_tangent(axis), other = glm::cross(axis, tangent);
    const vec3 scale(1, trial % 2 == 0 ? 1.0f : 0.5f, uniform(0.1f, 1));
    const vec4 section =
        trial % 3 == 0 ? vec4(0)
                       : vec4(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-90, 0));
    const float length = trial % 4 == 0 ? 0.0f : uniform(1, 50);
    const text::LitPoint point{ivec3(10, 20, 30),
                               vec3(uniform(0, 1), uniform(0, 1), uniform(0, 1))};
    const int count = 1 + static_cast<int>(random() % 40);
    std::vector<float> x, y, up;
    for (int i = 0; i < count; ++i) {
      const glm::vec2 disc = text::light_disc(i, count);
      x.push_back(disc.x);
      y.push_back(disc.y);
      up.push_back(std::sqrt(std::max(1.0f - glm::dot(disc, disc), 0.0f)));
    }
    MarchFan fan;
    const auto set = [](auto& to, const auto& from) {
      for (size_t i = 0; i < to.size(); ++i) to[i] = from[static_cast<int>(i)];
    };
    set(fan.base, point.cell);
    set(fan.origin, point.origin);
    set(fan.tangent, tangent);
    set(fan.other, other);
    set(fan.axis, axis);
    set(fan.scale, scale);
    set(fan.section, section);
    set(fan.level_t, text::light_levels(2, 8.0f));
    fan.length = length;
    fan.steps_max = 64;
    std::vector<float> per_side(static_cast<size_t>(count));
    rays_->count = 0;
    add(random_arguments(random, grid_));  // fans are appended
    kernel_.add_fan(fan, x.data(), y.data(), up.data(), count, *rays_, per_side.data());
    ASSERT_EQ(rays_->count, count + 1);
    for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
      const vec3 world = tangent * x[i] + other * y[i] + axis * up[i];
      const text::GridRay ray = text::light_ray(point, world, scale);
      const vec3 cells = glm::abs(world / scale);
      ASSERT_EQ(per_side[i], std::max(cells.x, std::max(cells.y, cells.z)));
      const float cut = text::light_section(section, ray);
      ASSERT_EQ(rays_->t_max[i + 1], length > 0 ? std::min(length * per_side[i], cut) : cut);
      for (size_t c = 0; c < 3; ++c) {
        const auto at = static_cast<int>(c);
        ASSERT_EQ(rays_->base[c][i + 1], ray.base[at]);
        ASSERT_EQ(rays_->cell[c][i + 1], point.cell[at]);
        ASSERT_EQ(rays_->origin[c][i + 1], ray.origin[at]);
        ASSERT_EQ(rays_->direction[c][i + 1], ray.direction[at]);
        ASSERT_EQ(rays_->inverse[c][i + 1], ray.inverse[at]);
      }
      ASSERT_EQ(rays_->steps_max[i + 1], 64);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Each, MarchKernels, ::testing::ValuesIn(supported_cpu_isas()),
                         [](const auto& tested) {
                           return std::string(cpu_isa_name(tested.param));
                         });

}  // namespace
}  // namespace voxeld
