// A description of a mesh file's contents, for people who choose among them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/scene/core/animated_scene.h"

namespace voxeld {

struct AssetDescription {
  struct Mesh {  // a part of the scene
    std::string name;
    int material = -1;  // index into materials; -1: none
    int64_t triangle_count = 0;
    int64_t influences_max = 0;      // of one vertex; 0 in a format without joints
    bool has_morph_targets = false;  // whether some target moves a vertex
  };
  struct Material {
    std::string name;
    std::string image;  // the texture, as the upload or the mesh names it; empty: none found
  };
  std::string format;  // Scene::format
  Box3d bounds;        // of the bind pose, world units
  std::vector<Mesh> meshes;
  std::vector<Material> materials;
  std::vector<MissingFile> missing_files;  // textures and other files that the upload lacks
  std::vector<SceneJoint> joints;
  std::vector<AnimationInfo> animations;
  std::vector<Warning> warnings;
};

AssetDescription describe_asset(const AnimatedScene& animated);

}  // namespace voxeld
