#include "server/voxel/snap.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "server/voxel/clip.h"
#include "server/voxel/parallel.h"

namespace voxeld {
namespace {

constexpr size_t kVertexGrain = 1 << 15;
constexpr size_t kTriangleGrain = 1 << 14;
// Rounding of the placement must not lose a face on the grid's box; in voxels.
constexpr double kBoundaryTolerance = 1.0 / 4096;

glm::dvec3 transformed(const glm::dmat4& world_from_file, const glm::dvec3& p_file) {
  return glm::dvec3(world_from_file * glm::dvec4(p_file, 1.0));
}

bool inside_box(const glm::dvec3& p, const glm::ivec3& dims) {
  // Written so that NaN is outside.
  return p.x >= -1.0 && p.x <= dims.x + 1.0 && p.y >= -1.0 && p.y <= dims.y + 1.0 && p.z >= -1.0 &&
         p.z <= dims.z + 1.0;
}

glm::ivec3 snapped(const glm::dvec3& p_grid, const glm::ivec3& dims) {
  return {snap_coordinate(p_grid.x, dims.x), snap_coordinate(p_grid.y, dims.y),
          snap_coordinate(p_grid.z, dims.z)};
}

// Triangles and clipped vertices of one chunk of one part; vertex numbers from `first_clipped` on
// count from the chunk's own first clipped vertex.
struct ChunkOutput {
  std::vector<SnappedTriangle> triangles;
  std::vector<ClippedVertex> clipped;
  std::vector<glm::ivec3> clipped_q;
  bool not_finite = false;
};

class TriangleSnapper {
 public:
  TriangleSnapper(const SnappedMesh& mesh, const MeshPart& part, uint32_t part_index,
                  const glm::dmat4& world_from_file, const GridSpec& spec)
      : mesh_(mesh),
        part_(part),
        part_index_(part_index),
        base_(mesh.part_first_vertex[part_index]),
        world_from_file_(world_from_file),
        spec_(spec) {}

  void run(size_t first, size_t last, ChunkOutput& out) const {
    out.triangles.reserve(last - first);
    for (size_t t = first; t < last; ++t) {
      const uint32_t* index = &part_.indices[3 * t];
      const std::array<uint32_t, 3> vertices = {base_ + index[0], base_ + index[1],
                                                base_ + index[2]};
      const glm::ivec3& a = mesh_.vertices[vertices[0]];
      const glm::ivec3& b = mesh_.vertices[vertices[1]];
      const glm::ivec3& c = mesh_.vertices[vertices[2]];
      if (a.x == kOutside || b.x == kOutside || c.x == kOutside) {
        add_clipped(vertices, out);
      } else {
        add(vertices, a, b, c, out);
      }
    }
  }

 private:
  void add(const std::array<uint32_t, 3>& vertices, const glm::ivec3& a, const glm::ivec3& b,
           const glm::ivec3& c, ChunkOutput& out) const {
    TileSpan span;
    for (int axis = 0; axis < 3; ++axis) {
      const int low = std::min({a[axis], b[axis], c[axis]}) >> limits::kSubVoxelBits;
      const int high = std::max({a[axis], b[axis], c[axis]}) >> limits::kSubVoxelBits;
      if (high < 0 || low >= spec_.dims[axis]) return;
      span.first[axis] = static_cast<uint32_t>(std::max(low, 0) / limits::kTileSide);
      span.last[axis] =
          static_cast<uint32_t>(std::min(high, spec_.dims[axis] - 1) / limits::kTileSide);
    }
    out.triangles.push_back({vertices, part_index_, span.packed()});
  }

  void add_clipped(const std::array<uint32_t, 3>& vertices, ChunkOutput& out) const {
    std::array<glm::dvec3, 3> p_grid;
    for (size_t i = 0; i < 3; ++i) {
      p_grid[i] = spec_.grid_from_world(
          transformed(world_from_file_, part_.positions[vertices[i] - base_]));
      if (!std::isfinite(p_grid[i].x + p_grid[i].y + p_grid[i].z)) {
        out.not_finite = true;
        return;
      }
    }
    const ClipPolygon polygon =
        clip_triangle(p_grid, glm::dvec3(-1.0), glm::dvec3(spec_.dims) + 1.0);
    const auto first = static_cast<uint32_t>(mesh_.file_vertex_count + out.clipped.size());
    for (size_t i = 0; i < polygon.count; ++i) {
      out.clipped.push_back({vertices, polygon.corners[i].weights});
      out.clipped_q.push_back(snapped(polygon.corners[i].p_grid, spec_.dims));
    }
    const glm::ivec3* q = out.clipped_q.data() + (first - mesh_.file_vertex_count);
    for (uint32_t i = 1; i + 1 < polygon.count; ++i) {
      add({first, first + i, first + i + 1}, q[0], q[i], q[i + 1], out);
    }
  }

  const SnappedMesh& mesh_;
  const MeshPart& part_;
  uint32_t part_index_;
  uint32_t base_;
  const glm::dmat4& world_from_file_;
  const GridSpec& spec_;
};

void snap_vertices(const MeshPart& part, const glm::dmat4& world_from_file, const GridSpec& spec,
                   glm::ivec3* out) {
  parallel_chunks(part.positions.size(), kVertexGrain, [&](size_t, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const glm::dvec3 p = spec.grid_from_world(transformed(world_from_file, part.positions[i]));
      out[i] = inside_box(p, spec.dims) ? snapped(p, spec.dims) : glm::ivec3(kOutside, 0, 0);
    }
  });
}

Status append(ChunkOutput& chunk, const MeshPart& part, SnappedMesh& mesh) {
  if (chunk.not_finite) {
    return Error{ErrorCode::kMalformedMesh,
                 "part \"" + part.name +
                     "\" has a vertex that is not "
                     "at a finite place in the grid",
                 "", ""};
  }
  const auto shift = static_cast<uint32_t>(mesh.clipped.size());
  if (!chunk.clipped.empty()) {
    for (SnappedTriangle& triangle : chunk.triangles) {
      for (uint32_t& vertex : triangle.vertices) {
        if (vertex >= mesh.file_vertex_count) vertex += shift;
      }
    }
  }
  mesh.triangles.insert(mesh.triangles.end(), chunk.triangles.begin(), chunk.triangles.end());
  mesh.clipped.insert(mesh.clipped.end(), chunk.clipped.begin(), chunk.clipped.end());
  mesh.vertices.insert(mesh.vertices.end(), chunk.clipped_q.begin(), chunk.clipped_q.end());
  return {};
}

}  // namespace

int32_t snap_coordinate(double p_grid, int dim) {
  if (p_grid >= -kBoundaryTolerance && p_grid < 0.0) return 0;
  if (p_grid >= dim && p_grid <= dim + kBoundaryTolerance) return dim * kSubVoxelsPerVoxel - 1;
  const double q = std::floor(p_grid * kSubVoxelsPerVoxel);
  // Rounding of clipped points may leave the box by its last bit.
  return static_cast<int32_t>(
      std::clamp(q, -double{kSubVoxelsPerVoxel}, (dim + 1.0) * kSubVoxelsPerVoxel));
}

uint32_t TileSpan::packed() const {
  return first[0] | first[1] << 4 | first[2] << 8 | last[0] << 12 | last[1] << 16 | last[2] << 20;
}

TileSpan TileSpan::unpack(uint32_t packed) {
  TileSpan span;
  for (uint32_t axis = 0; axis < 3; ++axis) {
    span.first[axis] = packed >> (4 * axis) & 15u;
    span.last[axis] = packed >> (4 * axis + 12) & 15u;
  }
  return span;
}

int part_image(const Scene& scene, size_t part) {
  const int material = scene.parts[part].material;
  if (material < 0 || scene.parts[part].uvs.empty()) return -1;
  return scene.materials[static_cast<size_t>(material)].image;
}

Box3d world_bounds(const Scene& scene, const glm::dmat4& world_from_file) {
  Box3d box;
  for (const MeshPart& part : scene.parts) {
    std::vector<uint8_t> used(part.positions.size());
    for (const uint32_t index : part.indices) used[index] = 1;
    std::vector<Box3d> boxes(chunk_count(part.positions.size(), kVertexGrain));
    parallel_chunks(part.positions.size(), kVertexGrain,
                    [&](size_t chunk, size_t begin, size_t end) {
                      Box3d own;
                      for (size_t i = begin; i < end; ++i) {
                        if (used[i] != 0) own.add(transformed(world_from_file, part.positions[i]));
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

Result<SnappedMesh> snap_scene(const Scene& scene, const glm::dmat4& world_from_file,
                               const GridSpec& spec) {
  SnappedMesh mesh;
  size_t vertex_count = 0;
  for (const MeshPart& part : scene.parts) {
    mesh.part_first_vertex.push_back(static_cast<uint32_t>(vertex_count));
    vertex_count += part.positions.size();
  }
  mesh.file_vertex_count = static_cast<uint32_t>(vertex_count);
  mesh.vertices.resize(vertex_count);
  for (size_t p = 0; p < scene.parts.size(); ++p) {
    snap_vertices(scene.parts[p], world_from_file, spec,
                  mesh.vertices.data() + mesh.part_first_vertex[p]);
  }
  std::vector<uint32_t> order(scene.parts.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return part_image(scene, a) < part_image(scene, b);
  });
  mesh.triangles.reserve(scene.triangle_count());
  for (const uint32_t p : order) {
    const MeshPart& part = scene.parts[p];
    const TriangleSnapper snapper(mesh, part, p, world_from_file, spec);
    std::vector<ChunkOutput> chunks(chunk_count(part.indices.size() / 3, kTriangleGrain));
    parallel_chunks(
        part.indices.size() / 3, kTriangleGrain,
        [&](size_t chunk, size_t begin, size_t end) { snapper.run(begin, end, chunks[chunk]); });
    for (ChunkOutput& chunk : chunks) VOXELD_TRY(append(chunk, part, mesh));
  }
  return mesh;
}

}  // namespace voxeld
