// The binding of an animated scene's vertices to its matrices, as plain arrays. A vertex stage on a
// GPU can read it as well as skin_vertices() on the CPU.
//
//   vertex v, in the order of the scene's parts     influences [first_influence[v], …[v + 1])
//     a point and a normal (or one of each per influence), in the space of the matrices' columns
//     morphs [first_morph[v], …[v + 1])             added to the point, times a weight of the pose
//
//   position(v) = sum over its influences of  weight * (world_from_bound[matrix] * point)
//   point       = the given one + sum over its morphs of  morph_weights[weight] * position delta
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "proto/result.h"
#include "server/base/pieces.h"
#include "server/scene/core/scene.h"

namespace voxeld {

// Influences, and morphs, of one scene. More: malformed-mesh. Each takes up to 52 bytes.
inline constexpr int64_t kSkinInfluencesMax = int64_t{1} << 26;

struct Influence {
  uint32_t matrix = 0;  // index into Pose::world_from_bound
  // glTF: above 0, with a sum of 1 per vertex. MD5: as in the file.
  double weight = 0.0;
};

struct MorphDelta {
  uint32_t weight = 0;  // index into Pose::morph_weights
  glm::vec3 position{0.0f}, normal{0.0f};
};

// One part while it is loaded, vertex by vertex; end_vertex() closes each.
struct SkinPart {
  std::vector<glm::dvec3> points;
  std::vector<glm::vec3> normals;
  std::vector<Influence> influences;
  std::vector<MorphDelta> morphs;
  std::vector<uint32_t> influence_ends, morph_ends;  // per vertex

  void end_vertex() {
    push_in_pieces(influence_ends, static_cast<uint32_t>(influences.size()));
    push_in_pieces(morph_ends, static_cast<uint32_t>(morphs.size()));
  }
};

struct SkinTable {
  std::vector<uint32_t> part_first_vertex;  // one per part, and the number of all vertices
  std::vector<uint32_t> first_influence;    // one per vertex, and the number of all influences
  std::vector<uint32_t> first_morph;        // likewise for morphs; empty if there are none
  std::vector<Influence> influences;
  std::vector<MorphDelta> morphs;
  // false: points per vertex (glTF); true: per influence (MD5, where each weight has a place in its
  // joint)
  bool is_point_per_influence = false;
  std::vector<glm::dvec3> points;  // units of the file
  // In the bind pose, one per point; (0, 0, 0): none. Unused for parts without normals.
  std::vector<glm::vec3> normals;

  size_t vertex_count() const { return first_influence.empty() ? 0 : first_influence.size() - 1; }
};

// Joins the parts in order. With points per influence there must be no morphs.
SkinTable join_skin_parts(std::vector<SkinPart> parts, bool is_point_per_influence);

// The matrices and weights that vertices follow at one time.
struct Pose {
  std::vector<glm::dmat4> world_from_bound;  // affine
  std::vector<double> morph_weights;
  glm::dvec3 root{0.0};  // place of the root joint in the world, for strip_root_motion()
};

// Positions and normals of a scene's vertices at one time, with the shape of its parts. The rest of
// the parts does not move.
struct FrameVertices {
  struct Part {
    std::vector<glm::dvec3> positions;  // world units
    std::vector<glm::vec3> normals;     // unit length; empty if the part has none
  };
  std::vector<Part> parts;
};

// Linear blend skinning into `out`, whose memory is reused. Large scenes are split among threads.
// `bind` has the parts from which the table was made.
//
// With points per vertex, the matrices are blended, and normals are transformed by the inverse
// transpose of the blend. With points per influence, the matrices must be rigid, and rotated
// normals are blended. A normal that vanishes is replaced by that of a triangle.
//
// Errors: malformed-mesh for a vertex without a finite position.
Status skin_vertices(const SkinTable& table, const Scene& bind, const Pose& pose,
                     FrameVertices& out);

}  // namespace voxeld
