// The triangles whose inside is filled. They are snapped like those of the surface, but none is
// clipped or dropped, because triangles outside the grid's box decide what is inside it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "server/voxel/triangles/snap.h"

namespace voxeld {

// A mesh whose corners are at (q + 1/2) / 2^sub_voxel_bits voxels. It may point into the
// SnappedMesh that it was made from.
class FillMesh {
 public:
  FillMesh() = default;
  FillMesh(FillMesh&&) = default;
  FillMesh& operator=(FillMesh&&) = default;

  size_t triangle_count() const { return triangle_count_; }
  int sub_voxel_bits() const { return sub_voxel_bits_; }
  // Corners in the world's orientation: mirroring transforms are undone.
  std::array<glm::ivec3, 3> corners(size_t triangle) const {
    const uint32_t* index = first_index_ + triangle * index_stride_;
    const size_t second = mirrored_ ? 2 : 1;
    return {vertices_[index[0]], vertices_[index[second]], vertices_[index[3 - second]]};
  }

  // Borrows the mesh if it holds every triangle unchanged; snaps the scene again if triangles were
  // clipped. Coordinates more than kFillCellsMax cells away from cell 0 are clamped to that.
  static FillMesh of(const Scene& scene, const glm::dmat4& world_from_file, const GridSpec& spec,
                     const SnappedMesh& mesh);
  // The bytes that such a mesh takes beside `mesh`: none if it borrows that.
  static int64_t own_bytes(const Scene& scene, const SnappedMesh& mesh);
  // The same triangles in a grid with 2^bits cells where there was one on each axis. They are not
  // snapped again. Borrows this mesh, which must outlive the result. bits: 0 to sub_voxel_bits().
  FillMesh scaled(int bits) const;
  // Makes a mesh of given corners, three for each triangle.
  static FillMesh of(std::vector<glm::ivec3> corners, int sub_voxel_bits);

 private:
  void own(std::vector<glm::ivec3> vertices, std::vector<uint32_t> indices);

  std::span<const glm::ivec3> vertices_;
  const uint32_t* first_index_ = nullptr;
  size_t index_stride_ = 3;
  size_t triangle_count_ = 0;
  int sub_voxel_bits_ = 8;
  bool mirrored_ = false;
  std::vector<glm::ivec3> own_vertices_;
  std::vector<uint32_t> own_indices_;
};

// 2^30 sub-voxels at 8 bits. Coordinates stay 32-bit integers, and products fit in 128 bits.
inline constexpr int kFillQMax = 1 << 30;

}  // namespace voxeld
