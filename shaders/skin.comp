// Moves the vertices of a frame to its pose (skin_vertices() of server/scene/core/skin_table.h) and
// snaps them (steps 1 and 2 of server/voxel/README.md). One invocation per vertex. It does the
// CPU's operations on doubles in the CPU's order, so that all bits are equal. Vertices outside the
// grid's cells are reported and left to the CPU. SKIN_POINT_PER_INFLUENCE: points per influence
// (MD5); otherwise points are per vertex, and SKIN_MORPHS moves them.
#include "shared/skin.h"
#include "lib/divide.glsl"

layout(local_size_x = SKIN_GROUP_SIZE) in;
layout(std430, binding = SKIN_VERTICES) writeonly buffer Vertices { int vertices[]; };
layout(std430, binding = SKIN_POSITIONS) writeonly buffer Positions { double positions[]; };
layout(std430, binding = SKIN_POINTS) readonly buffer Points { double points[]; };
layout(std430, binding = SKIN_FIRSTS) readonly buffer Firsts { uint firsts[]; };
layout(std430, binding = SKIN_INFLUENCES) readonly buffer Influences {
  SkinInfluence influences[];
};
layout(std430, binding = SKIN_MORPH_DELTAS) readonly buffer Morphs { SkinMorph morphs[]; };
layout(std430, binding = SKIN_FRAME) readonly buffer Frame { double frame[]; };
layout(std430, binding = SKIN_STATE) buffer State { uint state; };
layout(std140, binding = SKIN_PARAMS) uniform Params { SkinParams params; };

const int OUTSIDE = int(0x80000000u);  // kOutside
const double SUB_VOXELS = double(256);
const double BOUNDARY_TOLERANCE = double(1) / double(4096);

struct Affine {
  dvec3 x, y, z, w;  // columns
};

dvec3 point_at(uint index) {
  uint at = 3u * index;
  return dvec3(points[at], points[at + 1u], points[at + 2u]);
}

dvec3 of_frame(uint at) { return dvec3(frame[at], frame[at + 1u], frame[at + 2u]); }

Affine affine_at(uint at) {
  return Affine(of_frame(at), of_frame(at + 3u), of_frame(at + 6u), of_frame(at + 9u));
}

Affine pose_matrix(uint index) { return affine_at(uint(SKIN_MATRICES) + 12u * index); }

dvec3 moved(Affine m, dvec3 p) {
  precise dvec3 sum = m.x * p.x + m.y * p.y;
  sum = sum + m.z * p.z;
  sum = sum + m.w;
  return sum;
}

#if SKIN_POINT_PER_INFLUENCE
dvec3 skinned(uint vertex) {
  precise dvec3 position = dvec3(0.0);
  uint end = firsts[vertex + 1u];
  for (uint i = firsts[vertex]; i < end; ++i) {
    SkinInfluence influence = influences[i];
    precise dvec3 part = influence.weight * moved(pose_matrix(influence.matrix_index), point_at(i));
    position = position + part;
  }
  return position;
}
#else
dvec3 morphed(uint vertex) {
  precise dvec3 point = point_at(vertex);
#if SKIN_MORPHS
  uint at = params.vertex_count + 1u + vertex;
  uint end = firsts[at + 1u];
  for (uint i = firsts[at]; i < end; ++i) {
    SkinMorph morph = morphs[i];
    precise dvec3 part = frame[params.morph_weights + morph.weight_index] *
                         dvec3(morph.x, morph.y, morph.z);
    point = point + part;
  }
#endif
  return point;
}

dvec3 skinned(uint vertex) {
  dvec3 point = morphed(vertex);
  uint begin = firsts[vertex], end = firsts[vertex + 1u];
  if (end == begin + 1u) return moved(pose_matrix(influences[begin].matrix_index), point);
  precise dvec3 x = dvec3(0.0), y = dvec3(0.0), z = dvec3(0.0), w = dvec3(0.0);
  for (uint i = begin; i < end; ++i) {
    SkinInfluence influence = influences[i];
    Affine m = pose_matrix(influence.matrix_index);
    precise dvec3 part_x = influence.weight * m.x, part_y = influence.weight * m.y;
    precise dvec3 part_z = influence.weight * m.z, part_w = influence.weight * m.w;
    x = x + part_x;
    y = y + part_y;
    z = z + part_z;
    w = w + part_w;
  }
  return moved(Affine(x, y, z, w), point);
}
#endif

// Values that may be NaN are compared by their bits, because a compiler may invert a comparison.
bool is_at_most(double a, double limit) {
  uvec2 bits = unpackDouble2x32(abs(a)), most = unpackDouble2x32(limit);
  return bits.y < most.y || (bits.y == most.y && bits.x <= most.x);
}
bool are_at_most(dvec3 a, double limit) {
  return is_at_most(a.x, limit) && is_at_most(a.y, limit) && is_at_most(a.z, limit);
}

dvec3 world_from_file(dvec3 p) {
  if (params.is_turned == 0u) return p;
  Affine m = affine_at(uint(SKIN_WORLD_FROM_FILE));
  precise dvec3 first = m.x * p.x + m.y * p.y;
  precise dvec3 second = m.z * p.z + m.w;
  precise dvec3 sum = first + second;
  return sum;
}

dvec3 grid_from_world(dvec3 p) {
  dvec3 voxel = of_frame(uint(SKIN_VOXEL)), per_voxel = of_frame(uint(SKIN_PER_VOXEL));
  precise dvec3 from_origin = p - of_frame(uint(SKIN_ORIGIN));
  return dvec3(divided(from_origin.x, voxel.x, per_voxel.x),
               divided(from_origin.y, voxel.y, per_voxel.y),
               divided(from_origin.z, voxel.z, per_voxel.z));
}

// snap_coordinate() of server/voxel/triangles/snap.h; p in [-1, dim + 1].
int snapped(double p, int dim) {
  precise double at = p * SUB_VOXELS;
  int q = int(at);
  if (double(q) > at) --q;
  int in_box = clamp(q, -256, (dim + 1) * 256);
  double far_side = double(dim);
  if (p < double(0) && p >= -BOUNDARY_TOLERANCE) return 0;
  if (p >= far_side && p <= far_side + BOUNDARY_TOLERANCE) return dim * 256 - 1;
  return in_box;
}

ivec3 snapped(dvec3 p, ivec3 dims) {
  // The limit exceeds every grid; NaN fails the comparison.
  if (!are_at_most(p, double(32768))) return ivec3(OUTSIDE, 0, 0);
  dvec3 last = dvec3(dims) + dvec3(1.0);
  if (any(lessThan(p, dvec3(-1.0))) || any(greaterThan(p, last))) return ivec3(OUTSIDE, 0, 0);
  return ivec3(snapped(p.x, dims.x), snapped(p.y, dims.y), snapped(p.z, dims.z));
}

void main() {
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  uint vertex = group * uint(SKIN_GROUP_SIZE) + gl_LocalInvocationIndex;
  if (vertex >= params.vertex_count) return;
  dvec3 position = skinned(vertex);
  uint found = are_at_most(position, frame[SKIN_LIMIT]) ? 0u : SKIN_LOST;
  ivec3 dims = params.dims.xyz;
  ivec3 q = snapped(grid_from_world(world_from_file(position)), dims);
  bool in_cells = all(greaterThanEqual(q, ivec3(0))) && all(lessThan(q, dims * 256));
  if (!in_cells) found |= SKIN_OUTSIDE;
  if (found != 0u) atomicOr(state, found);
  uint at = 3u * vertex;
  vertices[at] = q.x;
  vertices[at + 1u] = q.y;
  vertices[at + 2u] = q.z;
  if (params.writes_positions == 0u) return;
  positions[at] = position.x;
  positions[at + 1u] = position.y;
  positions[at + 2u] = position.z;
}
