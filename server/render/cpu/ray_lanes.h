// The rays of a band of pixels in vector lanes: what main() of shaders/raymarch.frag does for one
// pixel after the other, with the same bits. Many eye rays march together, then all their rays for
// light.
//
// The types are those that glsl_to_cpp.py makes from the text, in a namespace of their own for each
// variant.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "server/render/cpu/kernels/march_kernel.h"
#include "shaders/glsl_float.h"
#include "shaders/shared/raymarch.h"

namespace voxeld::ray_lanes {

inline std::array<float, 3> array_of(const glm::vec3& v) {
  return {v.x, v.y, v.z};
}
inline std::array<float, 4> array_of(const glm::vec4& v) {
  return {v.x, v.y, v.z, v.w};
}
inline std::array<int32_t, 3> array_of(const glm::ivec3& v) {
  return {v.x, v.y, v.z};
}

template <typename Invocation, typename Grid>
MarchTables tables_of(const Invocation& invocation, const Grid& grid) {
  return {invocation.nodes, invocation.bricks, array_of(grid.low), array_of(grid.high),
          array_of(grid.tile_dims)};
}

// Estimated normals by cell. Neighbouring pixels and their samples often hit the same one.
class NormalMemo {
 public:
  // The normal of the cube of 2^level cells around a cell; made by estimate(), or remembered.
  template <typename Estimate>
  glm::vec3 at(const glm::ivec3& cell, int level, const Estimate& estimate) {
    const glm::ivec4 key(cell.x >> level, cell.y >> level, cell.z >> level, level);
    const auto mixed = static_cast<uint32_t>(key.x) * 0x9e3779b1u ^
                       static_cast<uint32_t>(key.y) * 0x85ebca6bu ^
                       static_cast<uint32_t>(key.z) * 0xc2b2ae35u;
    Entry& entry = entries_[mixed >> (32 - kBits)];
    if (entry.key != key) entry = {key, estimate()};
    return entry.normal;
  }

 private:
  static constexpr int kBits = 10;
  struct Entry {
    glm::ivec4 key{-1, -1, -1, -1};  // no cube's
    glm::vec3 normal{0.0f};
  };
  std::array<Entry, size_t{1} << kBits> entries_;
};

// The kernel, rays and normals that the pixels of a band share.
struct PixelLanes {
  explicit PixelLanes(const MarchKernel& march_kernel) : kernel(march_kernel) {}
  const MarchKernel& kernel;
  MarchRays rays;
  NormalMemo normals;
};

// The text calls this in place of march_estimated_normal().
template <typename Invocation>
glm::vec3 lanes_normal(Invocation& invocation, const glm::ivec3& cell, int level) {
  return invocation.lanes->normals.at(cell, level, [&] {
    return invocation.march_estimated_normal(invocation.march_grid(), cell, level,
                                             invocation.voxel_scale());
  });
}

// Appends the ray of a RayStart, with the other arguments of march().
template <typename Start>
void add_ray(const Start& start, const glm::vec4& level_t, int steps_max, MarchRays& rays) {
  const auto at = static_cast<size_t>(rays.count++);
  for (size_t c = 0; c < 3; ++c) {
    const auto axis = static_cast<glm::length_t>(c);
    rays.base[c][at] = start.ray.base[axis];
    rays.cell[c][at] = start.cell[axis];
    rays.origin[c][at] = start.ray.origin[axis];
    rays.direction[c][at] = start.ray.direction[axis];
    rays.inverse[c][at] = start.ray.inverse[axis];
  }
  for (size_t i = 0; i < 4; ++i) rays.level_t[i][at] = level_t[static_cast<glm::length_t>(i)];
  rays.t_max[at] = start.t_max;
  rays.steps_max[at] = steps_max;
}

// Points first, first + stride, ... of `count` on the unit disc (light_disc()), and their height on
// the hemisphere.
struct DiscPoints {
  std::vector<float> x, y, up;

  template <typename Invocation>
  DiscPoints(Invocation& invocation, int first, int stride, int count, float radius) {
    for (int i = first; i < count; i += stride) {
      const glm::vec2 disc = invocation.light_disc(i, count);
      x.push_back(disc.x * radius);
      y.push_back(disc.y * radius);
      up.push_back(std::sqrt(std::max(1.0f - glm::dot(disc, disc), 0.0f)));
    }
  }
  int count() const { return static_cast<int>(x.size()); }
};

// The rays of the samples of pixels.
template <typename Invocation, bool has_light>
class SampleRays {
 public:
  // `any`: of the pass.
  SampleRays(PixelLanes& lanes, Invocation any)
      : kernel_(lanes.kernel), rays_(lanes.rays), samples_(any.pixel_samples()) {
    if constexpr (has_light) {
      Invocation& first = any;
      for (int i = 0; i < samples_; ++i) {
        around_.emplace_back(first, i, samples_, first.open_rays(), 1.0f);
        to_light_.emplace_back(first, i, samples_, first.lit_rays(), RAYMARCH_LIGHT_RADIUS);
        std::ranges::fill(to_light_.back().up, 1.0f);
      }
    }
  }

  // seen_in_pixel() of `count` pixels. make(i): the invocation of one of them.
  template <typename Make>
  void find(const Make& make, int count, glm::vec4* sums) {
    const int pixels = std::max(1, kSamples / samples_);
    for (int first = 0; first < count; first += pixels) {
      find_some(make, first, std::min(pixels, count - first), sums + first);
    }
  }

 private:
  static constexpr int kSamples = 64;  // whose rays march together
  using Vec2 = glm::vec2;
  using Look = decltype(std::declval<Invocation>().look_at(Vec2()));
  using Sight = decltype(std::declval<Invocation>().seen(Vec2()));
  using March = decltype(Sight::found);
  using Surface = decltype(std::declval<Invocation>().surface_of(Sight()));
  struct Sample {
    Look look;
    Sight sight;
    Surface surface;
    float open = 1, lit = 1;
  };
  // The rays of a sample among those that march together.
  struct Fan {
    size_t sample;
    int first, open, lit;
  };

  // The index of sample i of a pixel in samples_of_.
  size_t number_of(int pixel, int i) const {
    return static_cast<size_t>(pixel) * static_cast<size_t>(samples_) + static_cast<size_t>(i);
  }

  template <typename Make>
  void find_some(const Make& make, int first, int count, glm::vec4* sums) {
    samples_of_.resize(number_of(count, 0));
    look(make, first, count);
    for (int pixel = 0; pixel < count; ++pixel) {
      Invocation invocation = make(first + pixel);
      for (int i = 0; i < samples_; ++i) {
        const size_t n = number_of(pixel, i);
        Sample& sample = samples_of_[n];
        if (!sample.sight.found.hit) continue;
        sample.surface = invocation.surface_of(sample.sight);
        if constexpr (has_light) add_light(invocation, n, i);
      }
    }
    if constexpr (has_light) {
      Invocation invocation = make(first);
      march_light(invocation);
    }
    for (int pixel = 0; pixel < count; ++pixel) {
      Invocation invocation = make(first + pixel);
      glm::vec4 sum(0.0f);
      for (int i = 0; i < samples_; ++i) {
        const Sample& sample = samples_of_[number_of(pixel, i)];
        if (!sample.sight.found.hit) continue;
        sum += glm::vec4(invocation.lit_color(sample.surface, {sample.open, sample.lit}), 1.0f);
      }
      sums[pixel] = sum;
    }
  }

  // Eye rays.
  template <typename Make>
  void look(const Make& make, int first, int count) {
    rays_.count = 0;
    numbers_.clear();
    for (int pixel = 0; pixel < count; ++pixel) {
      Invocation invocation = make(first + pixel);
      for (int i = 0; i < samples_; ++i) {
        const size_t n = number_of(pixel, i);
        Sample& sample = samples_of_[n];
        sample = {};
        sample.look = invocation.look_at(invocation.sample_place(i));
        sample.sight.found.hit = false;
        if (!sample.look.start.meets) continue;
        numbers_.push_back(n);
        add_ray(sample.look.start, sample.look.level_t, invocation.params.box_low.w, rays_);
      }
    }
    Invocation invocation = make(first);
    const auto grid = invocation.march_grid();
    kernel_.march(tables_of(invocation, grid), rays_);
    for (size_t ray = 0; ray < numbers_.size(); ++ray) {
      if (rays_.t[ray] < 0.0f) continue;
      Sample& sample = samples_of_[numbers_[ray]];
      March found;
      found.hit = true;
      found.cell = {rays_.hit[0][ray], rays_.hit[1][ray], rays_.hit[2][ray]};
      found.axis = rays_.axis[ray];
      found.t = rays_.t[ray];
      found.level = invocation.march_level(sample.look.level_t, found.t);
      const uint32_t entry = invocation.march_entry(grid, found.cell, found.level >= 5);
      found.part = invocation.march_node_of_entry(entry, found.cell, found.level).part;
      sample.sight = invocation.sight_of(sample.look, found);
    }
  }

  void add_light(Invocation& invocation, size_t sample, int index) {
    const auto query =
        invocation.light_query(samples_of_[sample].sight, samples_of_[sample].surface);
    const auto which = static_cast<size_t>(index);
    const int open = query.is_occluded ? around_[which].count() : 0;
    const int lit = query.is_shadowed ? to_light_[which].count() : 0;
    if (open + lit == 0) return;
    if (rays_of_light_ + open + lit > MarchRays::kMax) march_light(invocation);
    if (fans_.empty()) rays_.count = 0;
    fans_.push_back({sample, rays_.count, open, lit});
    MarchFan fan;
    fan.base = array_of(query.point.cell);
    fan.origin = array_of(query.point.origin);
    fan.scale = array_of(invocation.voxel_scale());
    fan.section = array_of(invocation.light_cut());
    const bool inside = invocation.light_is_inside(invocation.march_grid(), query.point.cell);
    const auto add = [&](const DiscPoints& points, const glm::vec3& axis, float cells_per_level,
                         int steps, float length) {
      const glm::vec3 tangent = invocation.light_tangent(axis);
      fan.tangent = array_of(tangent);
      fan.other = array_of(glm::cross(axis, tangent));
      fan.axis = array_of(axis);
      fan.level_t = array_of(invocation.light_levels(query.level, cells_per_level));
      fan.steps_max = inside ? steps : 0;
      fan.length = length;
      kernel_.add_fan(fan, points.x.data(), points.y.data(), points.up.data(), points.count(),
                      rays_, &per_side_[static_cast<size_t>(rays_.count)]);
    };
    if (open > 0) {
      add(around_[which], query.upward, 8.0f, RAYMARCH_OCCLUSION_STEPS,
          invocation.params.footprint.z);
    }
    if (lit > 0) {
      add(to_light_[which], glm::vec3(invocation.params.light_world), 64.0f, RAYMARCH_SHADOW_STEPS,
          0.0f);
    }
    rays_of_light_ = rays_.count;
  }

  // light_open() and light_shadow() of all fans.
  void march_light(Invocation& invocation) {
    if (fans_.empty()) return;
    kernel_.march(tables_of(invocation, invocation.march_grid()), rays_);
    const float length = invocation.params.footprint.z;
    for (const Fan& fan : fans_) {
      Sample& sample = samples_of_[fan.sample];
      float blocked = 0.0f, reached = 0.0f;
      for (int i = fan.first; i < fan.first + fan.open; ++i) {
        const float t = rays_.t[static_cast<size_t>(i)];
        const float far = length * per_side_[static_cast<size_t>(i)];
        const float near = t >= 0.0f ? std::max(1.0f - t / far, 0.0f) : 0.0f;
        blocked += near * near;
      }
      const int first_lit = fan.first + fan.open;
      for (int i = first_lit; i < first_lit + fan.lit; ++i) {
        reached += rays_.t[static_cast<size_t>(i)] >= 0.0f ? 0.0f : 1.0f;
      }
      if (fan.open > 0) sample.open = 1.0f - blocked / static_cast<float>(fan.open);
      if (fan.lit > 0) sample.lit = reached / static_cast<float>(fan.lit);
    }
    fans_.clear();
    rays_of_light_ = 0;
  }

  const MarchKernel& kernel_;
  MarchRays& rays_;
  const int samples_;
  std::vector<DiscPoints> around_, to_light_;  // for each sample of a pixel
  std::vector<Sample> samples_of_;             // of the pixels at hand
  std::vector<size_t> numbers_;                // the sample of each eye ray
  std::vector<Fan> fans_;
  int rays_of_light_ = 0;
  MarchRays::Each<float> per_side_;
};

// The sums of ground_darkness(), which calls this in C++ (RAYMARCH_LANES): what `count` rays meet
// towards the light (if `to_light_too`) and all around (if `around`). Rays that meet nothing add 0.
template <typename Invocation, typename Grid>
void lanes_ground(Invocation& invocation, const Grid& grid, const glm::dvec3& from,
                  const glm::vec3& to_light, const glm::vec3& scale, float length,
                  const glm::vec4& section, int count, bool to_light_too, bool around,
                  float& shadow, float& near) {
  constexpr float kFar = 3.0e38f;  // DDA_FAR
  constexpr size_t kCountMax = 64;
  using Ray = decltype(invocation.ground_ray(grid, from, to_light, scale, length, section, 0.0f));
  MarchRays& rays = invocation.lanes->rays;
  std::array<Ray, 2 * kCountMax> made;
  rays.count = 0;
  const auto add = [&](const Ray& ray, int steps) {
    if (!ray.start.meets) return;
    made[static_cast<size_t>(rays.count)] = ray;
    add_ray(ray.start, ray.level_t, steps, rays);
  };
  for (int i = 0; to_light_too && i < count; ++i) {
    const glm::vec3 world = invocation.ground_to_light(to_light, invocation.light_disc(i, count));
    add(invocation.ground_ray(grid, from, world, scale, kFar, section, 32.0f),
        RAYMARCH_SHADOW_STEPS);
  }
  const auto first_around = static_cast<size_t>(rays.count);
  for (int i = 0; around && i < count; ++i) {
    const glm::vec3 world = invocation.ground_upward(invocation.light_disc(i, count));
    add(invocation.ground_ray(grid, from, world, scale, length, section, 8.0f),
        RAYMARCH_OCCLUSION_STEPS);
  }
  invocation.lanes->kernel.march(tables_of(invocation, grid), rays);
  shadow = near = 0.0f;
  for (size_t i = 0; i < static_cast<size_t>(rays.count); ++i) {
    if (rays.t[i] < 0.0f) continue;
    const float met = invocation.ground_nearness(made[i], rays.t[i]);
    (i < first_around ? shadow : near) += i < first_around ? met : met * met;
  }
}

}  // namespace voxeld::ray_lanes
