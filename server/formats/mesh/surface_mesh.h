// A mesh of a grid's voxels in memory, as the writers of formats take it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/formats/mesh/voxel_colors.h"
#include "server/grid/grid.h"

namespace voxeld::mesh {

// Vertices of a mesh: indices are signed in some readers of PLY. More: grid-too-large.
inline constexpr uint64_t kVerticesMax = (uint64_t{1} << 31) - 1;
inline constexpr uint32_t kNoVertex = UINT32_MAX;

struct Vertex {
  std::array<float, 3> p_grid;  // of lattice points exact, as they are integers up to 16384
  Rgba color;
};

// Counter-clockwise seen from outside.
struct Face {
  std::array<uint32_t, 4> corners;  // a triangle's last one is kNoVertex
  bool is_quad() const { return corners[3] != kNoVertex; }
};

// An array whose elements are set by loops on several threads.
template <typename T>
class UnsetArray {
 public:
  UnsetArray() = default;
  explicit UnsetArray(size_t size)
      : data_(std::make_unique_for_overwrite<T[]>(size)), size_(size) {}
  size_t size() const { return size_; }
  T& operator[](size_t i) { return data_[i]; }
  const T& operator[](size_t i) const { return data_[i]; }
  std::span<const T> span() const { return {data_.get(), size_}; }

 private:
  std::unique_ptr<T[]> data_;
  size_t size_ = 0;
};

struct SurfaceMesh {
  UnsetArray<Vertex> vertices;
  UnsetArray<Face> faces;
  UnsetArray<std::array<float, 3>> normals;  // of vertices, in the grid; none: faces are flat
  bool has_colors = false;                   // several ones; otherwise all are those of the first
};

// The mesh of options.mesh. Each edge of a face is an edge of another face in the other direction,
// so it is closed. An exception is mesh=smooth of a band that ends at a hole of the input or at the
// grid's border. Equal grids give equal meshes. Errors: grid-too-large.
Result<SurfaceMesh> make_surface_mesh(const Grid& grid, const OutputOptions& options);

}  // namespace voxeld::mesh
