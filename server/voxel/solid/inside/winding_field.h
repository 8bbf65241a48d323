// Generalized winding numbers of meshes with holes, exact where it matters (Jacobson, Kavan &
// Sorkine-Hornung 2013, "Robust inside-outside segmentation using generalized winding numbers").
//
// A mesh M and the cones C that close it (boundary.h) have an integer winding number N, which
// signed crossings of columns give exactly. The mesh's own winding number is w = N - c, with c the
// solid angle of the few triangles of C over 4 pi. So w > 1/2 iff N > 1/2 + c. c changes slowly
// away from the cones, so that whole cubes have a single threshold for N.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <glm/vec3.hpp>

namespace voxeld {

class WindingField {
 public:
  // triangles: three corners each, q at `sub_voxel_bits`; those of closing_cones(), or of a mesh.
  // far_radii: from so many radii of a cluster on, its triangles count as one dipole.
  WindingField(const std::vector<glm::ivec3>& triangles, int sub_voxel_bits,
               double far_radii = kFarRadii);

  // Barill, Dickson, Schmidt, Levin & Jacobson 2018, "Fast winding numbers for soups and clouds",
  // take 2 radii with a higher order. From 8 on, the omitted part is below 1/16 of the most that a
  // cluster can add.
  static constexpr double kFarRadii = 8.0;

  // An upper bound of the bytes that it takes.
  static int64_t bytes_for(int64_t triangles);

  bool empty() const { return triangles_.empty(); }

  // The sum of the triangles' solid angles over 4 pi at the centre of a cell: the winding number of
  // a mesh, 1 inside of one that is closed and faces outwards.
  double winding(const glm::ivec3& cell) const { return value(centre(cell, 1), 0).c; }

  // The least integer N with N > 1/2 + c at the centre of a cell.
  int threshold(const glm::ivec3& cell) const;
  // The same for all cells of the cube whose first cell is `first`. nullopt if the cube may have
  // several thresholds.
  std::optional<int> threshold(const glm::ivec3& first, int side) const;

 private:
  // Corners in half sub-voxels, odd numbers, whereas centres of cells are even. a to b is an edge
  // of the mesh's boundary, c the cone's apex.
  struct Triangle {
    glm::i64vec3 a, b, c;
  };
  // A range of triangles_, halved along its longest side. The first child is the next node; the
  // other is at `second`.
  struct Node {
    uint32_t first, count, second;  // second: 0 for a leaf
    glm::dvec3 centre;              // centre of area, in half sub-voxels like all lengths here
    glm::dvec3 dipole;              // sum of the normals, each as long as its triangle's area
    double area, radius;
    double rim;  // length of the edges a to b, i.e. of the mesh's boundary
  };
  // c, and if half_diagonal > 0 a bound of its change within that distance.
  struct Value {
    double c = 0, change = 0;
  };

  // Bounds of the change of c within the half diagonal of a cube.
  struct Change {
    double by_area = 0, by_rim = 0, far_error = 0;
  };

  static bool comes_before(const Triangle& a, const Triangle& b, int axis);
  uint32_t build(uint32_t first, uint32_t count);
  Value value(const glm::i64vec3& p, double half_diagonal) const;
  // False if the cube meets the triangle, because c jumps there.
  bool add_change(const Triangle& triangle, const glm::dvec3& at, double half_diagonal,
                  Change& change) const;
  glm::i64vec3 centre(const glm::ivec3& first, int side) const;

  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
  int64_t half_cell_;
  double far_radii_;
};

}  // namespace voxeld
