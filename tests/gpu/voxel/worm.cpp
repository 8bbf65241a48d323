#include "tests/gpu/voxel/worm.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include <glm/gtc/matrix_transform.hpp>

namespace voxeld::pipelines {
namespace {

constexpr int kSides = 20, kJoints = 5;
constexpr double kLength = 10.0, kPi = 3.14159265358979323846;

Image noise() {
  std::mt19937 random(5);
  Image image{"noise", 128, 128, {}};
  for (int i = 0; i < 4 * 128 * 128; ++i) {
    image.rgba.push_back(i % 4 == 3 ? 255 : static_cast<uint8_t>(random()));
  }
  return image;
}

double joint_y(int joint) {
  return kLength * joint / (kJoints - 1);
}

struct Maker {
  bool is_md5;

  // A vertex that follows two joints, more the nearer it is to them.
  void add_vertex(MeshPart& part, SkinPart& skin, const glm::dvec3& p, float u, float v) const {
    part.positions.push_back(p);
    part.uvs.emplace_back(u, v);
    const double along = p.y / kLength * (kJoints - 1);
    const int below = std::min(static_cast<int>(along), kJoints - 2);
    const double above_share = along - below;
    add_influence(skin, p, below, 1.0 - above_share);
    if (above_share > 0.0) add_influence(skin, p, below + 1, above_share);
    if (!is_md5) {
      skin.points.push_back(p);
      skin.normals.emplace_back(0, 1, 0);
      if (p.y > 3.0 && p.y < 7.0) {
        skin.morphs.push_back({0, {0.3f * static_cast<float>(p.x), 0, 0.1f}, {}});
        skin.morphs.push_back({1, {0, 0.7f, 0.3f * static_cast<float>(p.z)}, {}});
      }
    }
    skin.end_vertex();
  }

  void add_influence(SkinPart& skin, const glm::dvec3& p, int joint, double weight) const {
    skin.influences.push_back({static_cast<uint32_t>(joint), weight});
    if (!is_md5) return;
    skin.points.push_back(p - glm::dvec3(0, joint_y(joint), 0));  // in the joint's own space
    skin.normals.emplace_back(0, 1, 0);
  }

  static void add_quads(MeshPart& part, int rows, int columns) {
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        const auto a = static_cast<uint32_t>(row * (columns + 1) + column);
        const auto above = a + static_cast<uint32_t>(columns) + 1;
        for (const uint32_t corner : {a, a + 1, above + 1, a, above + 1, above}) {
          part.indices.push_back(corner);
        }
      }
    }
  }
};

}  // namespace

Worm::Worm(bool is_md5, int rings) {
  const Maker maker{is_md5};
  std::vector<SkinPart> skins(2);
  MeshPart plate, tube;
  for (int row = 0; row <= 1; ++row) {
    for (int column = 0; column <= 1; ++column) {
      maker.add_vertex(plate, skins[0], {4.0 * column - 2, 0.0, 4.0 * row - 2}, 0.0f, 0.0f);
    }
  }
  maker.add_quads(plate, 1, 1);
  for (int ring = 0; ring <= rings; ++ring) {
    for (int side = 0; side <= kSides; ++side) {
      const double angle = 2 * kPi * side / kSides, share = static_cast<double>(ring) / rings;
      maker.add_vertex(tube, skins[1], {std::cos(angle), kLength * share, std::sin(angle)},
                       static_cast<float>(side) / kSides, static_cast<float>(share));
    }
  }
  maker.add_quads(tube, rings, kSides);
  scene.images.push_back(noise());
  scene.materials.resize(2);
  scene.materials[0].image = 0;
  scene.materials[1].base_color = {0.2f, 0.6f, 0.9f, 1.0f};
  tube.material = 0;
  plate.material = 1;
  // The one with an image comes second in the order of triangles, and first in the file.
  scene.parts = {std::move(tube), std::move(plate)};
  std::swap(skins[0], skins[1]);
  table = join_skin_parts(std::move(skins), is_md5);
}

Pose Worm::pose(int frame) const {
  const double phase = 2 * kPi * frame / 12;
  Pose pose;
  glm::dmat4 world(1.0);
  for (int joint = 0; joint < kJoints; ++joint) {
    if (joint > 0) world = glm::translate(world, {0.0, kLength / (kJoints - 1), 0.0});
    world = glm::rotate(world, 0.4 * std::sin(phase + 0.7 * joint), glm::dvec3(0.6, 0.0, 0.8));
    const glm::dvec3 bound(0.0, table.is_point_per_influence ? 0.0 : -joint_y(joint), 0.0);
    pose.world_from_bound.push_back(glm::translate(world, bound));
  }
  if (!table.first_morph.empty()) pose.morph_weights = {std::sin(phase), 0.5 * std::cos(phase)};
  return pose;
}

}  // namespace voxeld::pipelines
