// How the vertices of an animated scene follow its matrices, as plain arrays: what a vertex stage
// on a GPU reads as well as skin_vertices() on the CPU.
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
#include "server/scene/scene.h"

namespace voxeld {

// Influences, and morphs, of one scene: malformed-mesh above. One costs up to 52 bytes.
inline constexpr int64_t kSkinInfluencesMax = int64_t{1} << 26;

struct Influence {
  uint32_t matrix = 0;  // index into Pose::world_from_bound
  // Of glTF: above 0, adding up to 1 over a vertex. Of MD5: as the file has it.
  double weight = 0.0;
};

struct MorphDelta {
  uint32_t weight = 0;  // index into Pose::morph_weights
  glm::vec3 position{0.0f}, normal{0.0f};
};

// One part while it is loaded: vertex by vertex, each closed by end_vertex().
struct SkinPart {
  std::vector<glm::dvec3> points;
  std::vector<glm::vec3> normals;
  std::vector<Influence> influences;
  std::vector<MorphDelta> morphs;
  std::vector<uint32_t> influence_ends, morph_ends;  // per vertex

  void end_vertex() {
    influence_ends.push_back(static_cast<uint32_t>(influences.size()));
    morph_ends.push_back(static_cast<uint32_t>(morphs.size()));
  }
};

struct SkinTable {
  std::vector<uint32_t> part_first_vertex;  // one per part, and the number of all vertices
  std::vector<uint32_t> first_influence;    // one per vertex, and the number of all influences
  std::vector<uint32_t> first_morph;        // the same of morphs; empty where there are none
  std::vector<Influence> influences;
  std::vector<MorphDelta> morphs;
  // Per vertex (glTF), or per influence (MD5, whose weights each have a place in their joint).
  bool is_point_per_influence = false;
  std::vector<glm::dvec3> points;  // units of the file
  // Of the bind pose, beside the points; (0, 0, 0) for none. Of parts without normals: unused.
  std::vector<glm::vec3> normals;

  size_t vertex_count() const { return first_influence.empty() ? 0 : first_influence.size() - 1; }
};

// The parts one after another. With points per influence there must be no morphs.
SkinTable join_skin_parts(std::vector<SkinPart> parts, bool is_point_per_influence);

// What the vertices of a scene follow at one time.
struct Pose {
  std::vector<glm::dmat4> world_from_bound;  // affine
  std::vector<double> morph_weights;
  glm::dvec3 root{0.0};  // place of the root joint in the world, for strip_root_motion()
};

// Positions and normals of a scene's vertices at one time, shaped as in its parts; everything else
// of the parts does not move.
struct FrameVertices {
  struct Part {
    std::vector<glm::dvec3> positions;  // world units
    std::vector<glm::vec3> normals;     // unit length; empty where the part has none
  };
  std::vector<Part> parts;
};

// Linear blend skinning. Of points per vertex the matrices are blended and normals go by the
// inverse transpose of the blend; of points per influence the matrices must be rigid, and turned
// normals are blended. A normal that vanishes is replaced by that of a triangle. `bind` has the
// parts that the table was made of. Fills `out`, whose memory is used again. Large scenes are split
// among threads. Errors: malformed-mesh for a vertex that gets to no finite place.
Status skin_vertices(const SkinTable& table, const Scene& bind, const Pose& pose,
                     FrameVertices& out);

}  // namespace voxeld
