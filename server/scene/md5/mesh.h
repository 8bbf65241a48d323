// md5mesh files (id Software's Doom 3) as plain data.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "proto/messages/job.h"
#include "proto/result.h"
#include "server/scene/md5/lexer.h"

namespace voxeld {

// Joints of one mesh or animation. More: malformed-mesh.
inline constexpr int64_t kMd5JointsMax = 65'536;
// Weights of one vertex. Files have up to 14; without a limit, vertices times weights could take
// hours.
inline constexpr int64_t kMd5VertexWeightsMax = 256;
inline constexpr int kMd5RootParent = -1;

struct Md5Joint {
  std::string name;
  int parent = kMd5RootParent;  // < the joint's own index
  glm::dvec3 position{0.0};     // in the model, bind pose
  glm::dquat orientation{1.0, 0.0, 0.0, 0.0};
};

struct Md5Weight {
  uint32_t joint = 0;
  double bias = 0.0;
  glm::dvec3 position{0.0};  // in the joint
};

struct Md5Vertex {
  glm::vec2 uv{0.0f};  // (0,0): top left
  uint32_t first_weight = 0, weight_count = 0;
};

struct Md5Part {
  std::string name;    // empty for most
  std::string shader;  // a material's name, or a texture's
  std::vector<Md5Vertex> vertices;
  std::vector<uint32_t> indices;  // 3 per triangle, clockwise seen from outside
  std::vector<Md5Weight> weights;
};

struct Md5Mesh {
  std::vector<Md5Joint> joints;
  std::vector<Md5Part> parts;
  std::vector<Warning> warnings;  // wrong counts, numbers out of order
};

// Parses an md5mesh. The long keywords of the textbook grammar (numberOfJoints, numberOfMeshes,
// numberOfTriangles, triangle, numberOfWeights) are accepted; `name` appears in errors.
//
// A wrong count at the head is a warning, and the actual number counts; inside a mesh it is an
// error. Vertices, triangles and weights may come in any order of their numbers if each number
// occurs once. Otherwise their order counts, with a warning, as in the game.
//
// Errors: malformed-mesh with line, expected and got; unsupported-feature for versions other than
// 10.
Result<Md5Mesh> parse_md5_mesh(std::string_view name, std::string_view text);

// The orientation with x, y and z of the file. Its w is never positive, because the game's matrices
// are transposed. Returns nullopt if x, y and z are longer than a unit quaternion's by more than
// rounding.
std::optional<glm::dquat> md5_orientation(const glm::dvec3& xyz);

// Positions of a part's vertices in the model: the sum of bias * (joint position + joint
// orientation * weight position). `joints` are those of the mesh, in any pose.
std::vector<glm::dvec3> md5_positions(const Md5Part& part, const std::vector<Md5Joint>& joints);

// Reads "( x y z ) ( x y z )", the position and orientation of a joint.
Status read_md5_transform(Md5Lexer& lexer, glm::dvec3& position, glm::dquat& orientation);
// Reads name and parent of joint `index`.
Status read_md5_joint_name(Md5Lexer& lexer, size_t index, std::string& name, int& parent);

}  // namespace voxeld
