#include "server/scene/md5/rig.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "proto/file_names/file_names.h"
#include "proto/text/text_file.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/md5/load.h"

namespace voxeld {
namespace {

constexpr std::string_view kAnimExtension = ".md5anim";
constexpr double kUnevenWeights = 1e-2;  // tolerance of a sum of biases; files print six digits of
                                         // each

// A matrix with the joint's axes as columns and +y up.
glm::dmat4 world_from_joint(const glm::dvec3& position, const glm::dquat& orientation) {
  const glm::dmat3 turn = glm::mat3_cast(orientation);
  glm::dmat4 matrix(1.0);
  for (int c = 0; c < 3; ++c) matrix[c] = glm::dvec4(y_up_from_z_up(turn[c]), 0.0);
  matrix[3] = glm::dvec4(y_up_from_z_up(position), 1.0);
  return matrix;
}

Status add_part(std::string_view name, const Md5Mesh& mesh, const Md5Part& part,
                int64_t& influence_count, int64_t& uneven_count, SkinPart& out) {
  const std::vector<glm::dvec3> normals =
      md5_normals(md5_positions(part, mesh.joints), part.indices);
  for (size_t v = 0; v < part.vertices.size(); ++v) {
    cancel_point();
    const Md5Vertex& vertex = part.vertices[v];
    influence_count += vertex.weight_count;
    if (influence_count > kSkinInfluencesMax) {
      return over_limit(name, "", "weights of all vertices", kSkinInfluencesMax, influence_count);
    }
    double sum = 0.0;
    for (uint32_t i = 0; i < vertex.weight_count; ++i) {
      const Md5Weight& weight = part.weights[vertex.first_weight + i];
      const glm::dquat& bound = mesh.joints[weight.joint].orientation;
      push_in_pieces(out.influences, {weight.joint, weight.bias});
      push_in_pieces(out.points, weight.position);
      push_in_pieces(out.normals, glm::vec3(glm::conjugate(bound) * normals[v]));
      sum += weight.bias;
    }
    if (std::abs(sum - 1.0) > kUnevenWeights) ++uneven_count;
    out.end_vertex();
  }
  return {};
}

// Whether an entry has the extension and is not one that macOS left behind.
bool has_extension(std::string_view entry, std::string_view extension) {
  if (entry.size() <= extension.size() || entry.starts_with("__MACOSX/")) return false;
  const size_t stem_bytes = entry.size() - extension.size();
  const std::string_view stem = base_name(entry.substr(0, stem_bytes));
  return !stem.empty() && stem.front() != '.' &&
         equals_ignoring_case(entry.substr(stem_bytes), extension);
}

// The name of each animation file: "walk" for "models/walk.md5anim". Files of one name in several
// folders keep the folders in their names.
std::map<std::string, std::string> animation_names(const Bundle& bundle) {
  std::map<std::string, int> counts;
  std::map<std::string, std::string> names;
  for (const Bundle::Entry& entry : bundle.entries()) {
    if (!has_extension(entry.name, kAnimExtension)) continue;
    const std::string path = entry.name.substr(0, entry.name.size() - kAnimExtension.size());
    ++counts[std::string(base_name(path))];
    names.emplace(entry.name, path);
  }
  for (auto& [file, name] : names) {
    if (std::string stem(base_name(name)); counts[stem] == 1) name = std::move(stem);
  }
  return names;
}

Status add_animation(std::string_view mesh_name, const Bundle& bundle, const std::string& file,
                     const std::string& name, Md5Rig& rig, AnimatedScene& animated) {
  VOXELD_ASSIGN(const auto bytes, bundle.find(file, ""));
  if (!bytes) return Error{ErrorCode::kInternal, file + ": lost in the bundle", "", ""};
  std::string storage;
  VOXELD_ASSIGN(Md5Anim anim, parse_md5_anim(file, plain_text(*bytes, storage)));
  VOXELD_ASSIGN(std::vector<uint32_t> joints,
                match_md5_joints(mesh_name, rig.joints(), file, anim));
  for (Warning& warning : anim.warnings) {
    add_warning(animated.scene, warning.code, std::move(warning.detail));
  }
  animated.animations.push_back({.name = name,
                                 .frame_count = static_cast<int64_t>(anim.frame_count),
                                 .frame_rate = anim.frame_rate,
                                 .duration_s = anim.duration()});
  rig.add({std::move(anim), std::move(joints)});
  return {};
}

void add_animations(std::string_view mesh_name, const Bundle& bundle, Md5Rig& rig,
                    AnimatedScene& animated) {
  const std::map<std::string, std::string> names = animation_names(bundle);
  for (const Bundle::Entry& entry : bundle.entries()) {
    const auto name = names.find(entry.name);
    if (name == names.end()) continue;
    Status added = add_animation(mesh_name, bundle, entry.name, name->second, rig, animated);
    if (added) continue;
    add_warning(animated.scene, "ignored-animation", added.error().message());
    animated.animations.push_back({.name = name->second, .unusable = added.error()});
    rig.add({});
  }
}

}  // namespace

Pose Md5Rig::rest() const {
  Pose pose;
  for (const Md5Joint& joint : joints_) {
    pose.world_from_bound.push_back(world_from_joint(joint.position, joint.orientation));
  }
  pose.root = glm::dvec3(pose.world_from_bound.at(0)[3]);  // joint 0 is a root, because a parent
                                                           // precedes its joints
  return pose;
}

Pose Md5Rig::at(size_t animation, double seconds) const {
  const Clip& clip = clips_.at(animation);
  const std::vector<Md5Pose> model = md5_model_pose(clip.anim, md5_local_pose(clip.anim, seconds));
  Pose pose;
  pose.world_from_bound.reserve(joints_.size());
  for (const uint32_t joint : clip.anim_joints) {
    pose.world_from_bound.push_back(
        world_from_joint(model[joint].position, model[joint].orientation));
  }
  pose.root = glm::dvec3(pose.world_from_bound.at(0)[3]);
  return pose;
}

Result<SkinTable> md5_skin_table(std::string_view name, const Md5Mesh& mesh,
                                 int64_t& uneven_count) {
  std::vector<SkinPart> parts(mesh.parts.size());
  int64_t influence_count = 0;
  for (size_t p = 0; p < mesh.parts.size(); ++p) {
    VOXELD_TRY(add_part(name, mesh, mesh.parts[p], influence_count, uneven_count, parts[p]));
  }
  return join_skin_parts(std::move(parts), true);
}

Result<AnimatedScene> load_animated_md5(std::string_view name, std::span<const uint8_t> bytes,
                                        const Bundle& bundle, const LoadOptions& options) {
  std::string storage;
  VOXELD_ASSIGN(Md5Mesh mesh, parse_md5_mesh(name, plain_text(bytes, storage)));
  AnimatedScene animated;
  VOXELD_ASSIGN(animated.scene, md5_scene(name, mesh, bundle, options));
  int64_t uneven_count = 0;
  VOXELD_ASSIGN(animated.skin, md5_skin_table(name, mesh, uneven_count));
  if (uneven_count > 0) {
    add_warning(animated.scene, "uneven-weights",
                std::string(name) + ": the biases of " + std::to_string(uneven_count) +
                    " vertices do not add up to 1; they count as they are");
  }
  for (const Md5Joint& joint : mesh.joints) {
    animated.joints.push_back({joint.name, joint.parent});
  }
  auto rig = std::make_shared<Md5Rig>(std::move(mesh.joints));
  add_animations(name, bundle, *rig, animated);
  animated.rig = std::move(rig);
  return animated;
}

}  // namespace voxeld
