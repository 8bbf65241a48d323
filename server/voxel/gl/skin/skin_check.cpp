#include "server/voxel/gl/skin/skin_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "server/scene/core/animated_scene.h"
#include "server/voxel/gl/skin/skin_pass.h"
#include "server/voxel/triangles/snap.h"

namespace voxeld {
namespace {

constexpr size_t kPartVertices = 450;
constexpr size_t kParts = 2, kMatrices = 9, kMorphWeights = 3;

class SampleMaker {
 public:
  SampleMaker(uint64_t seed, bool is_point_per_influence, bool has_morphs, bool is_turned)
      : random_(seed), is_point_per_influence_(is_point_per_influence), has_morphs_(has_morphs) {
    sample_.spec.dims = {2048, 1500, 37};
    for (int c = 0; c < 3; ++c) {
      sample_.spec.origin_world[c] = real(-4.5, -3.5);
      sample_.spec.voxel_size[c] = real(7.0, 9.0) / sample_.spec.dims[c];
    }
    sample_.pose.world_from_bound.push_back(glm::dmat4(1.0));
    while (sample_.pose.world_from_bound.size() < kMatrices) {
      sample_.pose.world_from_bound.push_back(affine(0.0, 1.2, 2.0));
    }
    if (has_morphs) {
      for (size_t i = 0; i < kMorphWeights; ++i) sample_.pose.morph_weights.push_back(real(-1, 1));
    }
    if (is_turned) sample_.world_from_file = affine(1.0, 0.1, 0.5);
  }

  SkinSample make() {
    std::vector<SkinPart> parts(kParts);
    for (SkinPart& part : parts) {
      for (size_t v = 0; v < kPartVertices; ++v) add_vertex(part, v);
      sample_.scene.parts.emplace_back().positions.resize(kPartVertices);
    }
    sample_.table = join_skin_parts(std::move(parts), is_point_per_influence_);
    return std::move(sample_);
  }

 private:
  double real(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1p-53;
  }
  size_t below(size_t count) { return random_() % count; }
  glm::dvec3 reals(double low, double high) {
    const double x = real(low, high), y = real(low, high);
    return {x, y, real(low, high)};
  }
  glm::dmat4 affine(double diagonal, double spread, double reach) {
    glm::dmat4 m(diagonal);
    for (int column = 0; column < 3; ++column) {
      m[column] += glm::dvec4(reals(-spread, spread), 0.0);
    }
    m[3] = glm::dvec4(reals(-reach, reach), 1.0);
    return m;
  }

  // A coordinate on, or next to, a plane between sub-voxels.
  double near_plane(int axis) {
    const GridSpec& spec = sample_.spec;
    const size_t planes = static_cast<size_t>(spec.dims[axis]) * kSubVoxelsPerVoxel;
    const double q = static_cast<double>(below(planes + 1)) / kSubVoxelsPerVoxel;
    double at = spec.origin_world[axis] + q * spec.voxel_size[axis];
    for (size_t steps = below(3); steps > 0; --steps) at = std::nextafter(at, 1e9);
    for (size_t steps = below(3); steps > 0; --steps) at = std::nextafter(at, -1e9);
    return at;
  }

  // A coordinate at an offset, in voxels, from the grid's first or last plane. The offsets are
  // those at which the rules of the snap change.
  double near_side(int axis) {
    constexpr std::array<double, 12> kOffsets = {0,  0x1p-13, -0x1p-13, 0x1p-12, -0x1p-12, 0x1p-11,
                                                 -1, 1,       1.001,    -1.001,  1e6,      -1e29};
    const GridSpec& spec = sample_.spec;
    const double offset = kOffsets[below(kOffsets.size())];
    if (below(4) == 0) return below(2) == 0 ? 0.0 : -0.0;
    const double cells = below(2) == 0 ? 0.0 : spec.dims[axis];
    return spec.origin_world[axis] + (cells + offset) * spec.voxel_size[axis];
  }

  void add_vertex(SkinPart& part, size_t number) {
    if (number % 3 != 0) {
      const bool on_side = number % 9 == 1;
      glm::dvec3 p;
      for (int axis = 0; axis < 3; ++axis) p[axis] = on_side ? near_side(axis) : near_plane(axis);
      part.points.push_back(p);
      part.normals.emplace_back(0, 1, 0);
      part.influences.push_back({0, 1.0});  // a joint that does not move it
      return part.end_vertex();
    }
    const size_t count = 1 + below(5);
    double left = 1.0;
    for (size_t i = 0; i < count; ++i) {
      const double weight = i + 1 < count ? real(0.0, left) : left;
      left -= weight;
      part.influences.push_back({static_cast<uint32_t>(below(kMatrices)), weight});
    }
    for (size_t i = 0; i < (is_point_per_influence_ ? count : 1); ++i) {
      part.points.push_back(reals(-1.5, 1.5));
      part.normals.emplace_back(0, 1, 0);
    }
    for (size_t i = below(has_morphs_ ? 4 : 1); i > 0; --i) {
      part.morphs.push_back(
          {static_cast<uint32_t>(below(kMorphWeights)), glm::vec3(reals(-1, 1)), {}});
    }
    part.end_vertex();
  }

  std::mt19937_64 random_;
  bool is_point_per_influence_, has_morphs_;
  SkinSample sample_;
};

Result<bool> skins_exactly(const gpu::Context& context, SkinPass& pass, SkinSample& sample) {
  FrameVertices moved;
  VOXELD_TRY(skin_vertices(sample.table, sample.scene, sample.pose, moved));
  swap_vertices(moved, sample.scene);
  VOXELD_ASSIGN(const SnappedMesh expected,
                snap_scene(sample.scene, sample.world_from_file, sample.spec));
  const size_t count = sample.table.vertex_count();
  VOXELD_ASSIGN(const gpu::Buffer vertices,
                gpu::Buffer::create(context, count * sizeof(glm::ivec3), "vertices to compare"));
  VOXELD_TRY(pass.begin_frames(sample.table, 0));
  gpu::PassTimer timer(context);
  VOXELD_TRY(pass.run({sample.table, sample.pose, sample.spec, sample.world_from_file, true},
                      vertices, timer));
  std::vector<glm::ivec3> q(count);
  vertices.read(0, std::span(q));
  std::vector<glm::dvec3> positions(count);
  pass.read_positions(0, positions);
  const glm::dvec3* found = positions.data();
  for (const MeshPart& part : sample.scene.parts) {
    if (!std::equal(part.positions.begin(), part.positions.end(), found)) return false;
    found += part.positions.size();
  }
  return std::equal(q.begin(), q.end(), expected.vertices.begin());
}

}  // namespace

std::vector<SkinSample> skin_samples() {
  std::vector<SkinSample> samples;
  for (const bool is_turned : {false, true}) {
    samples.push_back(SampleMaker(71, true, false, is_turned).make());
    samples.push_back(SampleMaker(72, false, false, is_turned).make());
    samples.push_back(SampleMaker(73, false, true, is_turned).make());
  }
  return samples;
}

Result<bool> skins_exactly(const gpu::Context& context, SkinPass& pass) {
  for (SkinSample& sample : skin_samples()) {
    VOXELD_ASSIGN(const bool is_exact, skins_exactly(context, pass, sample));
    if (!is_exact) return false;
  }
  return true;
}

}  // namespace voxeld
