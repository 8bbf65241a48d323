#include "server/voxel/triangles/snap.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <glm/vector_relational.hpp>
#include <numeric>
#include <span>
#include <string>
#include <utility>

#include "server/base/floor.h"
#include "server/base/parallel.h"
#include "server/base/pieces.h"
#include "server/voxel/triangles/clip.h"
#include "server/voxel/triangles/split.h"

namespace voxeld {
namespace {

constexpr size_t kVertexGrain = 1 << 13;
constexpr size_t kSnapGrain = 1 << 14;
// Tolerance in voxels: rounding of the placement must not lose a face on the grid's box.
constexpr double kBoundaryTolerance = 1.0 / 4096;

// Step 1 in doubles, for many vertices.
class WorldFromFile {
 public:
  explicit WorldFromFile(const glm::dmat4& matrix)
      : matrix_(matrix), is_identity_(matrix == glm::dmat4(1.0)) {}

  glm::dvec3 operator()(const glm::dvec3& p_file) const {
    return is_identity_ ? p_file : glm::dvec3(matrix_ * glm::dvec4(p_file, 1.0));
  }

 private:
  glm::dmat4 matrix_;
  bool is_identity_;
};

bool inside_box(const glm::dvec3& p, const glm::ivec3& dims) {
  // NaN is outside. No short-circuit, because a few comparisons are cheaper than a mispredicted
  // branch.
  int outside = 0;
  for (int c = 0; c < 3; ++c) outside |= int{!(p[c] >= -1.0)} | int{!(p[c] <= dims[c] + 1.0)};
  return outside == 0;
}

// snap_coordinate(), defined here so that it is inlined.
int32_t snapped(double p_grid, int dim) {
  const int32_t q = floor_to_int(p_grid * kSubVoxelsPerVoxel);
  // Rounding can put clipped points outside the box by the last bit.
  const int32_t in_box = std::clamp(q, -kSubVoxelsPerVoxel, (dim + 1) * kSubVoxelsPerVoxel);
  const bool below = p_grid < 0.0 && p_grid >= -kBoundaryTolerance;
  const bool above = p_grid >= dim && p_grid <= dim + kBoundaryTolerance;
  return below ? 0 : above ? dim * kSubVoxelsPerVoxel - 1 : in_box;
}

glm::ivec3 snapped(const glm::dvec3& p_grid, const glm::ivec3& dims) {
  return {snapped(p_grid.x, dims.x), snapped(p_grid.y, dims.y), snapped(p_grid.z, dims.z)};
}

bool splits_edges(const GridSpec& spec) {
  return std::max({spec.dims.x, spec.dims.y, spec.dims.z}) > kUnsplitGridSide;
}

// The output of one chunk of a part's triangles. Vertex numbers from the mesh's file_vertex_count
// on are relative to the chunk's own first clipped vertex.
struct ChunkOutput {
  SnappedTriangle* whole = nullptr;     // destination of triangles that stay whole
  size_t whole_count = 0;               // at most the number of the chunk's triangles
  std::vector<SnappedTriangle> pieces;  // pieces of the other triangles
  std::vector<ClippedVertex> clipped;
  std::vector<glm::ivec3> clipped_q;
  bool not_finite = false;
  bool too_many = false;

  size_t bytes() const {
    return pieces.size() * sizeof(pieces[0]) +
           clipped.size() * (sizeof(clipped[0]) + sizeof(clipped_q[0]));
  }
};

class TriangleSnapper {
 public:
  TriangleSnapper(const SnappedMesh& mesh, const MeshPart& part, uint32_t part_index,
                  const WorldFromFile& world_from_file, const GridSpec& spec, size_t bytes_max)
      : mesh_(mesh),
        part_(part),
        part_index_(part_index),
        base_(mesh.part_first_vertex[part_index]),
        world_from_file_(world_from_file),
        spec_(spec),
        splits_(splits_edges(spec)),
        bytes_max_(bytes_max) {}

  // For a chunk whose vertices are all in cells of the grid.
  void run_inside(size_t first, size_t last, ChunkOutput& out) const {
    for (size_t t = first; t < last; ++t) {
      cancel_point_at(t);
      const uint32_t* index = &part_.indices[3 * t];
      out.whole[t - first] = {{base_ + index[0], base_ + index[1], base_ + index[2]}, part_index_};
    }
    out.whole_count = last - first;
  }

  void run(size_t first, size_t last, ChunkOutput& out) const {
    for (size_t t = first; t < last && !out.not_finite && !out.too_many; ++t) {
      cancel_point_at(t);
      const uint32_t* index = &part_.indices[3 * t];
      const std::array<uint32_t, 3> vertices = {base_ + index[0], base_ + index[1],
                                                base_ + index[2]};
      const glm::ivec3& a = mesh_.vertices[vertices[0]];
      const glm::ivec3& b = mesh_.vertices[vertices[1]];
      const glm::ivec3& c = mesh_.vertices[vertices[2]];
      const bool clips = std::min(a.x, std::min(b.x, c.x)) == kOutside;
      if (clips || (splits_ && may_be_long(a, b, c))) {
        add_pieces(vertices, out);
      } else {
        // Written without a branch. A triangle that misses the box is overwritten by the next one.
        out.whole[out.whole_count] = {vertices, part_index_};
        out.whole_count += touches_box(a, b, c) ? 1 : 0;
      }
    }
  }

 private:
  static bool may_be_long(const glm::ivec3& a, const glm::ivec3& b, const glm::ivec3& c) {
    const glm::ivec3 extent = glm::max(a, glm::max(b, c)) - glm::min(a, glm::min(b, c));
    return std::max({extent.x, extent.y, extent.z}) >=
           (static_cast<int>(kEdgeCellsMax) - 1) * kSubVoxelsPerVoxel;
  }

  bool touches_box(const glm::ivec3& a, const glm::ivec3& b, const glm::ivec3& c) const {
    int misses = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const int low = std::min(a[axis], std::min(b[axis], c[axis]));
      const int high = std::max(a[axis], std::max(b[axis], c[axis]));
      misses |= int{high < 0} | int{low >= spec_.dims[axis] * kSubVoxelsPerVoxel};
    }
    return misses == 0;
  }

  // Adds the pieces that clipping and splitting leave of a triangle.
  void add_pieces(const std::array<uint32_t, 3>& vertices, ChunkOutput& out) const {
    cancel_point();
    std::array<glm::dvec3, 3> p_grid;
    for (size_t i = 0; i < 3; ++i) {
      p_grid[i] = spec_.grid_from_world(world_from_file_(part_.positions[vertices[i] - base_]));
      if (!std::isfinite(p_grid[i].x + p_grid[i].y + p_grid[i].z)) {
        out.not_finite = true;
        return;
      }
    }
    const ClipPolygon polygon =
        clip_triangle(p_grid, glm::dvec3(-1.0), glm::dvec3(spec_.dims) + 1.0);
    if (splits_) {
      std::vector<SplitTriangle> pieces;
      for (size_t i = 1; i + 1 < polygon.count; ++i) {
        split_triangle({polygon.corners[0], polygon.corners[i], polygon.corners[i + 1]}, pieces);
      }
      for (const SplitTriangle& piece : pieces) add_fan(vertices, piece, out);
    } else {
      add_fan(vertices, {polygon.corners.data(), polygon.count}, out);
    }
    out.too_many = out.bytes() > bytes_max_;
  }

  void add_fan(const std::array<uint32_t, 3>& vertices, std::span<const ClipCorner> corners,
               ChunkOutput& out) const {
    const auto first = static_cast<uint32_t>(mesh_.file_vertex_count + out.clipped.size());
    for (const ClipCorner& corner : corners) {
      push_in_pieces(out.clipped, {vertices, corner.weights});
      push_in_pieces(out.clipped_q, snapped(corner.p_grid, spec_.dims));
    }
    const glm::ivec3* q = out.clipped_q.data() + (first - mesh_.file_vertex_count);
    for (uint32_t i = 1; i + 1 < corners.size(); ++i) {
      if (!touches_box(q[0], q[i], q[i + 1])) continue;
      push_in_pieces(out.pieces, {{first, first + i, first + i + 1}, part_index_});
    }
  }

  const SnappedMesh& mesh_;
  const MeshPart& part_;
  uint32_t part_index_;
  uint32_t base_;
  const WorldFromFile& world_from_file_;
  const GridSpec& spec_;
  bool splits_;
  size_t bytes_max_;
};

// Snaps a part's vertices. Returns true if all are in cells of the grid: then no triangle misses or
// leaves it.
bool snap_vertices(const MeshPart& part, const WorldFromFile& world_from_file, const GridSpec& spec,
                   glm::ivec3* out) {
  std::atomic<bool> all_in_cells = true;
  parallel_chunks(part.positions.size(), kVertexGrain, [&](size_t, size_t begin, size_t end) {
    glm::ivec3 low(0), high(0);
    for (size_t i = begin; i < end; ++i) {
      cancel_point_at(i);
      const glm::dvec3 p = spec.grid_from_world(world_from_file(part.positions[i]));
      out[i] = inside_box(p, spec.dims) ? snapped(p, spec.dims) : glm::ivec3(kOutside, 0, 0);
      low = glm::min(low, out[i]);
      high = glm::max(high, out[i]);
    }
    const bool in_cells = glm::all(glm::greaterThanEqual(low, glm::ivec3(0))) &&
                          glm::all(glm::lessThan(high, spec.dims * kSubVoxelsPerVoxel));
    if (!in_cells) all_in_cells = false;
  });
  return all_in_cells;
}

Status check(const ChunkOutput& chunk, const MeshPart& part, int64_t bytes_max) {
  if (chunk.not_finite) {
    return Error{ErrorCode::kMalformedMesh,
                 "part \"" + part.name +
                     "\" has a vertex that is not "
                     "at a finite place in the grid",
                 "", ""};
  }
  if (chunk.too_many) {
    return Error{ErrorCode::kGridTooLarge,
                 "part \"" + part.name +
                     "\" has too many triangles that leave the grid or are as long as it",
                 "pieces of them in at most " + std::to_string(bytes_max) + " bytes", "more"};
  }
  return {};
}

void append_pieces(ChunkOutput& chunk, SnappedMesh& mesh) {
  const auto shift = static_cast<uint32_t>(mesh.clipped.size());
  for (SnappedTriangle piece : chunk.pieces) {
    cancel_point();
    for (uint32_t& vertex : piece.vertices) vertex += shift;
    push_in_pieces(mesh.triangles, piece);
  }
  append_in_pieces(mesh.clipped, chunk.clipped);
  append_in_pieces(mesh.vertices, chunk.clipped_q);
  free_in_pieces(chunk.pieces);
  free_in_pieces(chunk.clipped);
  free_in_pieces(chunk.clipped_q);
}

Status snap_triangles(const MeshPart& part, uint32_t part_index,
                      const WorldFromFile& world_from_file, const GridSpec& spec, int64_t bytes_max,
                      SnappedMesh& mesh) {
  const size_t first = mesh.triangles.size(), count = part.indices.size() / 3;
  make_room_in_pieces(mesh.triangles, count);
  mesh.triangles.resize(first + count);
  std::vector<ChunkOutput> chunks(chunk_count(count, kSnapGrain));
  const TriangleSnapper snapper(mesh, part, part_index, world_from_file, spec,
                                static_cast<size_t>(bytes_max) / chunks.size());
  parallel_chunks(count, kSnapGrain, [&](size_t chunk, size_t begin, size_t end) {
    chunks[chunk].whole = mesh.triangles.data() + first + begin;
    if (mesh.is_whole) {
      snapper.run_inside(begin, end, chunks[chunk]);
    } else {
      snapper.run(begin, end, chunks[chunk]);
    }
  });
  SnappedTriangle* end = mesh.triangles.data() + first;
  for (const ChunkOutput& chunk : chunks) {
    VOXELD_TRY(check(chunk, part, bytes_max));
    if (end != chunk.whole) {
      in_pieces(chunk.whole_count, kPieceElements<SnappedTriangle>, [&](size_t from, size_t to) {
        std::copy(chunk.whole + from, chunk.whole + to, end + from);
      });
    }
    end += chunk.whole_count;
  }
  mesh.triangles.resize(static_cast<size_t>(end - mesh.triangles.data()));
  for (ChunkOutput& chunk : chunks) append_pieces(chunk, mesh);
  return {};
}

// 1 for each vertex of the part that a triangle uses, else 0.
std::vector<uint8_t> used_vertices(const MeshPart& part) {
  std::vector<uint8_t> used;
  resize_in_pieces(used, part.positions.size());
  parallel_chunks(part.indices.size(), 4 * kSnapGrain, [&](size_t, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      cancel_point_at(i);
      std::atomic_ref(used[part.indices[i]]).store(1, std::memory_order_relaxed);
    }
  });
  return used;
}

}  // namespace

int32_t snap_coordinate(double p_grid, int dim) {
  return snapped(p_grid, dim);
}

int part_image(const Scene& scene, size_t part) {
  const int material = scene.parts[part].material;
  if (material < 0 || scene.parts[part].uvs.empty()) return -1;
  return scene.materials[static_cast<size_t>(material)].image;
}

Box3d world_bounds(const Scene& scene, const glm::dmat4& matrix) {
  const WorldFromFile world_from_file(matrix);
  Box3d box;
  for (const MeshPart& part : scene.parts) {
    const std::vector<uint8_t> used = used_vertices(part);
    std::vector<Box3d> boxes(chunk_count(part.positions.size(), kVertexGrain));
    parallel_chunks(part.positions.size(), kVertexGrain,
                    [&](size_t chunk, size_t begin, size_t end) {
                      Box3d own;
                      for (size_t i = begin; i < end; ++i) {
                        cancel_point_at(i);
                        if (used[i] != 0) own.add(world_from_file(part.positions[i]));
                      }
                      boxes[chunk] = own;
                    });
    for (const Box3d& one : boxes) {
      if (one.empty()) continue;
      box.add(one.min);
      box.add(one.max);
    }
  }
  return box;
}

Result<SnappedMesh> snap_scene(const Scene& scene, const glm::dmat4& matrix, const GridSpec& spec,
                               int64_t bytes_max, SnappedMesh before) {
  const WorldFromFile world_from_file(matrix);
  SnappedMesh mesh = std::move(before);
  const bool was_whole = mesh.is_whole;
  mesh.part_first_vertex.clear();
  mesh.clipped.clear();
  size_t vertex_count = 0;
  for (const MeshPart& part : scene.parts) {
    mesh.part_first_vertex.push_back(static_cast<uint32_t>(vertex_count));
    vertex_count += part.positions.size();
  }
  mesh.file_vertex_count = static_cast<uint32_t>(vertex_count);
  mesh.vertices.resize(vertex_count);
  bool all_in_cells = true;
  for (size_t p = 0; p < scene.parts.size(); ++p) {
    const bool in_cells = snap_vertices(scene.parts[p], world_from_file, spec,
                                        mesh.vertices.data() + mesh.part_first_vertex[p]);
    all_in_cells = all_in_cells && in_cells;
  }
  mesh.is_whole = all_in_cells && !splits_edges(spec);
  if (mesh.is_whole && was_whole) return mesh;
  mesh.triangles.clear();
  std::vector<uint32_t> order(scene.parts.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return part_image(scene, a) < part_image(scene, b);
  });
  for (const uint32_t p : order) {
    VOXELD_TRY(snap_triangles(scene.parts[p], p, world_from_file, spec, bytes_max, mesh));
  }
  return mesh;
}

void settle_faces(const glm::ivec3& dims, bool is_mirrored, SnappedMesh& mesh) {
  for (SnappedTriangle& triangle : mesh.triangles) {
    cancel_point();
    const std::array<glm::ivec3, 3> corners = {mesh.vertices[triangle.vertices[0]],
                                               mesh.vertices[triangle.vertices[1]],
                                               mesh.vertices[triangle.vertices[2]]};
    for (int axis = 0; axis < 3; ++axis) {
      const int u = (axis + 1) % 3, v = (axis + 2) % 3, q = corners[0][axis];
      if (corners[1][axis] != q || corners[2][axis] != q) continue;
      const glm::i64vec3 a = glm::i64vec3(corners[1]) - glm::i64vec3(corners[0]);
      const glm::i64vec3 b = glm::i64vec3(corners[2]) - glm::i64vec3(corners[0]);
      const int64_t normal = (a[u] * b[v] - a[v] * b[u]) * (is_mirrored ? -1 : 1);
      const int plane = (q + 1) >> limits::kSubVoxelBits;
      const int first = plane * kSubVoxelsPerVoxel;  // of the cell above the plane
      if (normal == 0 || (q != first && q != first - 1)) continue;
      const int moved = normal > 0 ? first - 1 : first;
      if (moved == q || moved < 0 || moved >= dims[axis] * kSubVoxelsPerVoxel) continue;
      for (size_t i = 0; i < 3; ++i) {
        ClippedVertex vertex;
        vertex.corners.fill(triangle.vertices[i]);
        vertex.weights = {1, 0, 0};
        if (triangle.vertices[i] >= mesh.file_vertex_count) {
          vertex = mesh.clipped[triangle.vertices[i] - mesh.file_vertex_count];
        }
        glm::ivec3 at = corners[i];
        at[axis] = moved;
        triangle.vertices[i] = static_cast<uint32_t>(mesh.vertices.size());
        push_in_pieces(mesh.vertices, at);
        push_in_pieces(mesh.clipped, vertex);
      }
      mesh.is_whole = false;
    }
  }
}

}  // namespace voxeld
