// The vertices of an MD5 mesh at a time of an animation, from the text of the files: own
// reader, rotations as matrices, sums written out. Shares no code with the daemon.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/reference/rigid_math.h"

namespace voxeld::reference {

struct OracleMd5Joint {
  std::string name;
  int parent = -1;
  Affine model_from_joint;  // bind pose
};

struct OracleMd5Weight {
  size_t joint = 0;
  double bias = 0;
  Vec3 place{};
};

struct OracleMd5Part {
  std::vector<std::array<size_t, 2>> vertices;   // first weight, number of weights
  std::vector<std::array<size_t, 3>> triangles;  // clockwise
  std::vector<OracleMd5Weight> weights;
};

struct OracleMd5Mesh {
  std::vector<OracleMd5Joint> joints;
  std::vector<OracleMd5Part> parts;
};

struct OracleMd5Anim {
  double frame_rate = 24;
  std::vector<std::string> names;
  std::vector<int> parents, flags, firsts;
  std::vector<std::array<double, 6>> base;
  std::vector<std::vector<double>> frames;
};

// Reads well-formed files with entries in order.
OracleMd5Mesh read_md5_mesh(const std::string& text);
OracleMd5Anim read_md5_anim(const std::string& text);

struct OraclePart {
  std::vector<Vec3> positions, normals;
};

// Vertices of each part with +y up; normals are those of the bind pose, each turned with the joints
// of its vertex and blended. anim null: the bind pose. Joints are found by name.
std::vector<OraclePart> md5_frame(const OracleMd5Mesh& mesh, const OracleMd5Anim* anim,
                                  double seconds);

}  // namespace voxeld::reference
