#include "server/formats/mesh/rectangle_mesh.h"

#include <array>
#include <string>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/base/parallel.h"
#include "server/formats/mesh/lattice_points.h"
#include "server/formats/mesh/vertex_table.h"

namespace voxeld::mesh {
namespace {

// The vertices on the edges of a rectangle:
//
//   v1  top[0] ---- top[1] ---- top.back()
//         |                        |
//       left[0]                 right[0]
//         |                        |
//   v0 bottom[0] --------------- bottom.back()
//       u0                        u1
struct Outline {
  std::vector<uint32_t> bottom, top;  // by u, with both corners
  std::vector<uint32_t> left, right;  // by v, without corners

  size_t size() const { return bottom.size() + top.size() + left.size() + right.size(); }
  size_t face_count() const { return size() == 4 ? 1 : size() - 2; }
};

// A point of the lattice: its brick of points, and its number in that.
struct PointPlace {
  uint32_t brick, in_brick;
};

// The points of a slab's planes. A brick's number is looked up once.
class SlabPoints {
 public:
  SlabPoints(const LatticePoints& points, const RectangleSlab& slab, std::vector<uint32_t>& bricks)
      : points_(points),
        slab_(slab),
        bricks_(bricks),
        u_axis_(kPlaneAxes[slab.axis][0]),
        v_axis_(kPlaneAxes[slab.axis][1]) {
    bricks_.assign(size_t{2} * kSide * kSide, kNone);
  }

  PointPlace at(int u, int v, int plane) const {
    const int layer = (plane >> 3) - slab_.at;
    const int number = (layer * kSide + (v >> 3)) * kSide + (u >> 3);
    uint32_t& brick = bricks_[static_cast<size_t>(number)];
    if (brick == kNone) {
      TilePoint p{};
      p[u_axis_] = u;
      p[v_axis_] = v;
      p[slab_.axis] = plane;
      brick = points_.brick_of(slab_.tile, p);
    }
    return {brick, static_cast<uint32_t>((u & 7) << (3 * u_axis_) | (v & 7) << (3 * v_axis_) |
                                         (plane & 7) << (3 * slab_.axis))};
  }
  bool is_marked(const PointPlace& place) const {
    return points_.is_marked(place.brick, place.in_brick);
  }

 private:
  static constexpr int kSide = kTileBricks + 1;  // the last points lie in the next tile

  const LatticePoints& points_;
  const RectangleSlab& slab_;
  std::vector<uint32_t>& bricks_;
  size_t u_axis_, v_axis_;
};

// Fills `outline` by vertex(place) of each vertex.
template <typename VertexOf>
void make_outline(const SlabPoints& points, const Rectangle& r, Outline& outline,
                  VertexOf&& vertex) {
  const auto add = [&](int u, int v, std::vector<uint32_t>& edge) {
    edge.push_back(vertex(points.at(u, v, r.plane)));
  };
  const auto add_marked = [&](int u, int v, std::vector<uint32_t>& edge) {
    const PointPlace place = points.at(u, v, r.plane);
    if (points.is_marked(place)) edge.push_back(vertex(place));
  };
  const auto along_u = [&](int v, std::vector<uint32_t>& edge) {
    edge.clear();
    add(r.u0, v, edge);
    for (int u = r.u0 + 1; u < r.u1; ++u) add_marked(u, v, edge);
    add(r.u1, v, edge);
  };
  const auto along_v = [&](int u, std::vector<uint32_t>& edge) {
    edge.clear();
    for (int v = r.v0 + 1; v < r.v1; ++v) add_marked(u, v, edge);
  };
  along_u(r.v0, outline.bottom);
  along_u(r.v1, outline.top);
  along_v(r.u0, outline.left);
  along_v(r.u1, outline.right);
}

// Writes faces with the winding of a plane's direction.
class FaceWriter {
 public:
  // u, v and the normal's axis are right-handed for axes x and z.
  FaceWriter(Face* out, uint32_t axis, bool is_positive)
      : out_(out), is_swapped_((axis == 1) == is_positive) {}

  Face* end() const { return out_; }
  void quad(uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
    *out_++ = is_swapped_ ? Face{{a, d, c, b}} : Face{{a, b, c, d}};
  }
  void triangle(uint32_t a, uint32_t b, uint32_t c) {
    *out_++ = is_swapped_ ? Face{{a, c, b, kNoVertex}} : Face{{a, b, c, kNoVertex}};
  }

  // No triangle has three vertices on one edge. Those on the left edge form a fan around the second
  // vertex of the bottom, those on the right edge a fan around the last but one of the top; between
  // them is a strip from bottom to top.
  void polygon(const Outline& outline) {
    const auto& [bottom, top, left, right] = outline;
    if (outline.size() == 4) return quad(bottom[0], bottom[1], top[1], top[0]);
    const auto fan = [&](uint32_t centre, uint32_t first, const std::vector<uint32_t>& edge,
                         uint32_t last, bool is_right) {
      for (size_t i = 0; i <= edge.size(); ++i) {
        const uint32_t low = i == 0 ? first : edge[i - 1];
        const uint32_t high = i == edge.size() ? last : edge[i];
        is_right ? triangle(centre, low, high) : triangle(centre, high, low);
      }
    };
    fan(bottom[1], bottom.front(), left, top.front(), false);
    fan(top[top.size() - 2], bottom.back(), right, top.back(), true);
    size_t b = 1, t = 0;
    const size_t b_end = bottom.size() - 1, t_end = top.size() - 2;
    while (b < b_end || t < t_end) {
      // The side that is behind, by its part of the way, so that triangles are not too thin.
      const bool moves_bottom = b < b_end && (t == t_end || b * t_end <= t * b_end);
      if (moves_bottom) {
        triangle(bottom[b], bottom[b + 1], top[t]);
        ++b;
      } else {
        triangle(bottom[b], top[t + 1], top[t]);
        ++t;
      }
    }
  }

 private:
  Face* out_;
  bool is_swapped_;
};

// Calls work(number, slab, points) for all slabs, on all threads.
template <typename Work>
void for_each_slab(const LatticePoints& points, std::span<const RectangleSlab> slabs, Work&& work) {
  parallel_for(slabs.size(), [&](size_t i) {
    cancel_point();
    static thread_local std::vector<uint32_t> bricks;
    work(i, slabs[i], SlabPoints(points, slabs[i], bricks));
  });
}

void mark_corners(std::span<const RectangleSlab> slabs, LatticePoints& points) {
  for_each_slab(points, slabs, [&](size_t, const RectangleSlab& slab, const SlabPoints& of_slab) {
    for (const Rectangle& r : slab.rectangles) {
      for (const int u : {r.u0, r.u1}) {
        for (const int v : {r.v0, r.v1}) {
          const PointPlace place = of_slab.at(u, v, r.plane);
          points.mark(place.brick, place.in_brick);
        }
      }
    }
  });
}

}  // namespace

Result<SurfaceMesh> mesh_of_rectangles(const VoxelBricks& voxels,
                                       std::span<const RectangleSlab> slabs, bool has_colors,
                                       std::string_view format) {
  LatticePoints points(voxels);
  mark_corners(slabs, points);
  VertexTable table(points, has_colors);

  std::vector<uint64_t> faces_before(slabs.size() + 1);
  for_each_slab(points, slabs, [&](size_t i, const RectangleSlab& slab, const SlabPoints& at) {
    Outline outline;
    uint64_t faces = 0;
    for (const Rectangle& r : slab.rectangles) {
      make_outline(at, r, outline, [&](const PointPlace& place) {
        if (has_colors) table.count(place.brick);
        return kNoVertex;
      });
      faces += outline.face_count();
    }
    faces_before[i + 1] = faces;
  });
  for (size_t i = 0; i < slabs.size(); ++i) faces_before[i + 1] += faces_before[i];

  if (has_colors) {
    table.begin();
    for_each_slab(points, slabs, [&](size_t, const RectangleSlab& slab, const SlabPoints& at) {
      Outline outline;
      for (const Rectangle& r : slab.rectangles) {
        make_outline(at, r, outline, [&](const PointPlace& place) {
          table.add(place.brick, place.in_brick, r.color);
          return kNoVertex;
        });
      }
    });
  }
  table.number_vertices();
  if (table.size() > kVerticesMax) {
    return Error{ErrorCode::kGridTooLarge, std::string(format) + ": too many vertices for a mesh",
                 "at most " + std::to_string(kVerticesMax), std::to_string(table.size())};
  }

  Rgba color = 0;
  for (const RectangleSlab& slab : slabs) {
    if (!slab.rectangles.empty()) color = slab.rectangles.front().color;
  }
  SurfaceMesh mesh;
  mesh.vertices = table.vertices(color);
  mesh.faces = UnsetArray<Face>(faces_before.back());
  for_each_slab(points, slabs, [&](size_t i, const RectangleSlab& slab, const SlabPoints& at) {
    if (slab.rectangles.empty()) return;
    Outline outline;
    Face* out = &mesh.faces[faces_before[i]];
    for (const Rectangle& r : slab.rectangles) {
      make_outline(at, r, outline, [&](const PointPlace& place) {
        return table.find(place.brick, place.in_brick, r.color);
      });
      FaceWriter writer(out, slab.axis, r.is_positive);
      writer.polygon(outline);
      out = writer.end();
    }
  });
  return mesh;
}

}  // namespace voxeld::mesh
