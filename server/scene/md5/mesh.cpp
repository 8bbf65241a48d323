#include "server/scene/md5/mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"

namespace voxeld {
namespace {

// Files print six digits, so orientations are not exactly of unit length.
constexpr double kOrientationTolerance = 1e-2;
// Bytes of the shortest entries, "vert 0(0 0)0 1", "tri 0 0 0 0" and "weight 0 0 0(0 0 0)". They
// bound the counts at the head by the size of the file.
constexpr int64_t kVertexBytesMin = 14, kTriangleBytesMin = 11, kWeightBytesMin = 19;

// Sorts entries by their numbers, if these are 0..n-1, each once. Otherwise returns false.
template <typename Entry>
bool sort_by_number(std::vector<Entry>& entries, const std::vector<uint32_t>& numbers) {
  std::vector<uint8_t> seen;
  resize_in_pieces(seen, entries.size());
  bool in_order = true;
  for (size_t i = 0; i < numbers.size(); ++i) {
    cancel_point();
    if (numbers[i] >= entries.size() || seen[numbers[i]] != 0) return false;
    seen[numbers[i]] = 1;
    in_order = in_order && numbers[i] == i;
  }
  if (in_order) return true;
  std::vector<Entry> sorted;
  resize_in_pieces(sorted, entries.size());
  for (size_t i = 0; i < numbers.size(); ++i) {
    cancel_point();
    sorted[numbers[i]] = entries[i];
  }
  entries = std::move(sorted);
  return true;
}

class Md5MeshReader {
 public:
  Md5MeshReader(std::string_view name, std::string_view text) : lexer_(name, text) {}

  Result<Md5Mesh> read() {
    VOXELD_TRY(read_md5_head(lexer_));
    int64_t joint_count = -1, part_count = -1;
    for (;;) {
      VOXELD_ASSIGN(const Md5Token token, lexer_.next());
      if (token.kind == Md5Token::kEnd) break;
      if (token.is("numJoints") || token.is("numberOfJoints")) {
        VOXELD_ASSIGN(joint_count, lexer_.integer("numJoints", 0, kMd5JointsMax));
      } else if (token.is("numMeshes") || token.is("numberOfMeshes")) {
        VOXELD_ASSIGN(part_count, lexer_.integer("numMeshes", 0, kScenePartsMax));
      } else if (token.is("joints")) {
        if (!mesh_.joints.empty()) return lexer_.wrong("a second block", "mesh", token);
        VOXELD_TRY(read_joints());
      } else if (token.is("mesh")) {
        VOXELD_TRY(read_part());
      } else {
        return lexer_.wrong("unknown keyword", "numJoints, numMeshes, joints or mesh", token);
      }
    }
    if (mesh_.joints.empty()) {
      return malformed_mesh(lexer_.name(), "", "no joints", "joints { … }", "");
    }
    if (mesh_.parts.empty()) return empty_mesh(lexer_.name(), "no meshes");
    VOXELD_TRY(check_weights());
    warn_count("numJoints", joint_count, mesh_.joints.size());
    warn_count("numMeshes", part_count, mesh_.parts.size());
    return std::move(mesh_);
  }

 private:
  void warn(std::string_view code, const std::string& detail) {
    if (mesh_.warnings.size() < kSceneWarningsMax) {
      mesh_.warnings.push_back({std::string(code), lexer_.name() + ": " + detail});
    }
  }

  void warn_count(std::string_view keyword, int64_t said, size_t there) {
    if (said < 0 || said == static_cast<int64_t>(there)) return;
    warn("wrong-count", std::string(keyword) + " says " + std::to_string(said) + ", the file has " +
                            std::to_string(there));
  }

  Status read_joints() {
    VOXELD_TRY(lexer_.expect('{', "joints"));
    for (;;) {
      VOXELD_ASSIGN(const Md5Token token, lexer_.peek());
      if (token.is('}')) return lexer_.expect('}', "joints");
      if (mesh_.joints.size() == static_cast<size_t>(kMd5JointsMax)) {
        return over_limit(lexer_.name(), "line " + std::to_string(token.line), "too many joints",
                          kMd5JointsMax, kMd5JointsMax + 1);
      }
      Md5Joint joint;
      VOXELD_TRY(read_md5_joint_name(lexer_, mesh_.joints.size(), joint.name, joint.parent));
      VOXELD_TRY(read_md5_transform(lexer_, joint.position, joint.orientation));
      mesh_.joints.push_back(std::move(joint));
    }
  }

  // Joints may follow the meshes, so weights are checked at the end.
  Status read_part() {
    if (mesh_.parts.size() == kScenePartsMax) {
      VOXELD_ASSIGN(const Md5Token token, lexer_.peek());
      return over_limit(lexer_.name(), "line " + std::to_string(token.line), "too many meshes",
                        kScenePartsMax, kScenePartsMax + 1);
    }
    VOXELD_TRY(lexer_.expect('{', "mesh"));
    Md5Part part;
    for (;;) {
      VOXELD_ASSIGN(const Md5Token token, lexer_.next());
      if (token.is('}')) {
        VOXELD_TRY(check_part(part, token));
        mesh_.parts.push_back(std::move(part));
        return {};
      }
      VOXELD_TRY(read_statement(token, part));
    }
  }

  Status read_statement(const Md5Token& token, Md5Part& part) {
    if (token.is("name")) {
      VOXELD_ASSIGN(part.name, lexer_.string("name"));
    } else if (token.is("shader")) {
      VOXELD_ASSIGN(part.shader, lexer_.string("shader"));
    } else if (token.is("numverts") || token.is("numberOfVertices")) {
      return read_vertices(part);
    } else if (token.is("numtris") || token.is("numberOfTriangles")) {
      return read_triangles(part);
    } else if (token.is("numweights") || token.is("numberOfWeights")) {
      return read_weights(part);
    } else {
      return lexer_.wrong("unknown keyword", "name, shader, numverts, numtris, numweights or }",
                          token);
    }
    return {};
  }

  // Reads a count and checks that the rest of the file can hold so many.
  Result<int64_t> count(std::string_view what, int64_t bytes_min, int64_t limit) {
    VOXELD_ASSIGN(const Md5Token token, lexer_.peek());
    VOXELD_ASSIGN(const int64_t said, lexer_.integer(what, 0, limit));
    const auto left = static_cast<int64_t>(lexer_.bytes_left());
    if (said > left / bytes_min) {
      return malformed_line(lexer_.name(), token.line,
                            "truncated: " + std::string(what) + " " + std::to_string(said),
                            "at least " + std::to_string(said * bytes_min) + " bytes",
                            std::to_string(left) + " bytes left");
    }
    return said;
  }

  // Reads `count` entries that begin with one of two keywords and a number.
  template <typename Entry, typename ReadEntry>
  Status read_entries(int64_t count, std::string_view keyword, std::string_view long_keyword,
                      std::vector<Entry>& entries, const ReadEntry& read_entry) {
    std::vector<uint32_t> numbers;
    numbers.reserve(static_cast<size_t>(count));
    entries.clear();
    entries.reserve(static_cast<size_t>(count));
    for (int64_t i = 0; i < count; ++i) {
      VOXELD_ASSIGN(const Md5Token token, lexer_.next());
      if (!token.is(keyword) && !token.is(long_keyword)) {
        return lexer_.wrong(std::string(keyword) + " " + std::to_string(i) + " of " +
                                std::to_string(count) + " is missing",
                            std::string(keyword), token);
      }
      VOXELD_ASSIGN(const int64_t number, lexer_.integer(keyword, 0, UINT32_MAX));
      numbers.push_back(static_cast<uint32_t>(number));
      Entry entry{};
      VOXELD_TRY(read_entry(entry));
      entries.push_back(entry);
    }
    VOXELD_ASSIGN(const Md5Token after, lexer_.peek());
    if (after.is(keyword) || after.is(long_keyword)) {
      return lexer_.wrong("more entries than were announced",
                          std::to_string(count) + " of " + std::string(keyword), after);
    }
    if (!sort_by_number(entries, numbers)) {
      warn("wrong-numbers", "mesh " + std::to_string(mesh_.parts.size()) + ": the numbers of " +
                                std::string(keyword) + " are not " + index_range(count, keyword) +
                                ", each once; their order counts");
    }
    return {};
  }

  Status read_vertices(Md5Part& part) {
    VOXELD_ASSIGN(const int64_t said, count("numverts", kVertexBytesMin, limits::kVerticesMax));
    return read_entries(said, "vert", "vertex", part.vertices, [&](Md5Vertex& vertex) -> Status {
      double uv[2];
      VOXELD_TRY(lexer_.numbers("texture coordinates", uv, 2));
      vertex.uv = glm::vec2(uv[0], uv[1]);
      VOXELD_ASSIGN(const int64_t first, lexer_.integer("first weight", 0, UINT32_MAX));
      VOXELD_ASSIGN(const int64_t weights,
                    lexer_.integer("number of weights", 1, kMd5VertexWeightsMax));
      vertex.first_weight = static_cast<uint32_t>(first);
      vertex.weight_count = static_cast<uint32_t>(weights);
      return {};
    });
  }

  Status read_triangles(Md5Part& part) {
    using Triangle = std::array<uint32_t, 3>;
    VOXELD_ASSIGN(const int64_t said, count("numtris", kTriangleBytesMin, limits::kTrianglesMax));
    std::vector<Triangle> triangles;
    VOXELD_TRY(read_entries(said, "tri", "triangle", triangles, [&](Triangle& t) -> Status {
      for (uint32_t& corner : t) {
        VOXELD_ASSIGN(const int64_t vertex, lexer_.integer("vertex of a triangle", 0, UINT32_MAX));
        corner = static_cast<uint32_t>(vertex);
      }
      return {};
    }));
    part.indices.clear();
    part.indices.reserve(3 * triangles.size());
    for (const Triangle& t : triangles) {
      cancel_point();
      part.indices.insert(part.indices.end(), t.begin(), t.end());
    }
    return {};
  }

  Status read_weights(Md5Part& part) {
    VOXELD_ASSIGN(const int64_t said, count("numweights", kWeightBytesMin, limits::kVerticesMax));
    return read_entries(said, "weight", "weight", part.weights, [&](Md5Weight& weight) -> Status {
      VOXELD_ASSIGN(const int64_t joint, lexer_.integer("joint of a weight", 0, kMd5JointsMax - 1));
      weight.joint = static_cast<uint32_t>(joint);
      VOXELD_ASSIGN(weight.bias, lexer_.number("bias"));
      return lexer_.numbers("position of a weight", &weight.position.x, 3);
    });
  }

  // Checks that the vertices and triangles refer to existing items. `end` is the token that closes
  // the mesh.
  Status check_part(const Md5Part& part, const Md5Token& end) const {
    const std::string where =
        "line " + std::to_string(end.line) + ", mesh " + std::to_string(mesh_.parts.size());
    const auto fail = [&](const std::string& what, size_t there, std::string_view things,
                          uint64_t got) {
      return malformed_mesh(lexer_.name(), where, what,
                            index_range(static_cast<int64_t>(there), things), std::to_string(got));
    };
    for (size_t v = 0; v < part.vertices.size(); ++v) {
      cancel_point();
      const Md5Vertex& vertex = part.vertices[v];
      const uint64_t last = uint64_t{vertex.first_weight} + vertex.weight_count - 1;
      if (last >= part.weights.size()) {
        return fail("vert " + std::to_string(v) + " has a weight that is not there",
                    part.weights.size(), "weights", last);
      }
    }
    for (size_t i = 0; i < part.indices.size(); ++i) {
      cancel_point();
      if (part.indices[i] >= part.vertices.size()) {
        return fail("tri " + std::to_string(i / 3) + " has a vertex that is not there",
                    part.vertices.size(), "vertices", part.indices[i]);
      }
    }
    return {};
  }

  Status check_weights() const {
    for (size_t p = 0; p < mesh_.parts.size(); ++p) {
      const std::vector<Md5Weight>& weights = mesh_.parts[p].weights;
      for (size_t w = 0; w < weights.size(); ++w) {
        cancel_point();
        if (weights[w].joint < mesh_.joints.size()) continue;
        return malformed_mesh(lexer_.name(), "mesh " + std::to_string(p),
                              "weight " + std::to_string(w) + " has a joint that is not there",
                              index_range(static_cast<int64_t>(mesh_.joints.size()), "joints"),
                              std::to_string(weights[w].joint));
      }
    }
    return {};
  }

  Md5Lexer lexer_;
  Md5Mesh mesh_;
};

}  // namespace

std::optional<glm::dquat> md5_orientation(const glm::dvec3& xyz) {
  const double squared = glm::dot(xyz, xyz);
  if (squared > 1.0 + kOrientationTolerance) return std::nullopt;
  const double w = -std::sqrt(std::max(0.0, 1.0 - squared));
  return glm::normalize(glm::dquat(w, xyz.x, xyz.y, xyz.z));
}

Status read_md5_transform(Md5Lexer& lexer, glm::dvec3& position, glm::dquat& orientation) {
  VOXELD_TRY(lexer.numbers("position of a joint", &position.x, 3));
  VOXELD_ASSIGN(const Md5Token token, lexer.peek());
  glm::dvec3 xyz;
  VOXELD_TRY(lexer.numbers("orientation of a joint", &xyz.x, 3));
  const auto turned = md5_orientation(xyz);
  if (!turned) {
    return malformed_line(lexer.name(), token.line, "orientation of a joint",
                          "x, y, z of a unit quaternion",
                          "length " + std::to_string(glm::length(xyz)));
  }
  orientation = *turned;
  return {};
}

Status read_md5_joint_name(Md5Lexer& lexer, size_t index, std::string& name, int& parent) {
  VOXELD_ASSIGN(const Md5Token token, lexer.next());
  if (token.kind != Md5Token::kString) {
    return lexer.wrong("name of a joint", "a string in quotes, or }", token);
  }
  name = std::string(token.text);
  const auto before = static_cast<int64_t>(index);
  VOXELD_ASSIGN(const int64_t number,
                lexer.integer("parent of joint " + shown(name), kMd5RootParent, before - 1,
                              before == 0 ? "-1, as no joint is before it"
                                          : "-1 or the number of a joint before it, " +
                                                index_range(before, "joints")));
  parent = static_cast<int>(number);
  return {};
}

std::vector<glm::dvec3> md5_positions(const Md5Part& part, const std::vector<Md5Joint>& joints) {
  std::vector<glm::dvec3> positions;
  positions.reserve(part.vertices.size());
  for (const Md5Vertex& vertex : part.vertices) {
    cancel_point();  // vertices may share their weights, so a small file has many of them
    glm::dvec3 sum(0.0);
    for (uint32_t i = 0; i < vertex.weight_count; ++i) {
      const Md5Weight& weight = part.weights[vertex.first_weight + i];
      const Md5Joint& joint = joints[weight.joint];
      sum += weight.bias * (joint.position + joint.orientation * weight.position);
    }
    positions.push_back(sum);
  }
  return positions;
}

Result<Md5Mesh> parse_md5_mesh(std::string_view name, std::string_view text) {
  return Md5MeshReader(name, text).read();
}

}  // namespace voxeld
