// The triangles whose inside is filled: snapped as those of the surface, but none is clipped or
// left out, because what lies beside the grid's box decides what is inside of it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "server/voxel/snap.h"

namespace voxeld {

// Corners stand at (q + 1/2) / 2^sub_voxel_bits voxels. May point into the SnappedMesh that it was
// made of.
class FillMesh {
 public:
  FillMesh() = default;
  FillMesh(FillMesh&&) = default;
  FillMesh& operator=(FillMesh&&) = default;

  size_t triangle_count() const { return triangle_count_; }
  int sub_voxel_bits() const { return sub_voxel_bits_; }
  // Orientation is the world's: mirroring transforms are undone.
  std::array<glm::ivec3, 3> corners(size_t triangle) const {
    const uint32_t* index = first_index_ + triangle * index_stride_;
    const size_t second = mirrored_ ? 2 : 1;
    return {vertices_[index[0]], vertices_[index[second]], vertices_[index[3 - second]]};
  }

  // Borrows the mesh where it has every triangle as it is, and snaps the scene again where
  // triangles were clipped. A coordinate that lies further than kFillCellsMax cells beside cell 0
  // is moved to there.
  static FillMesh of(const Scene& scene, const glm::dmat4& world_from_file, const GridSpec& spec,
                     const SnappedMesh& mesh);
  // The same triangles where 2^bits cells lie on each axis where one lay, without snapping them
  // again. Borrows this one, which must outlive it. bits: 0 to sub_voxel_bits().
  FillMesh scaled(int bits) const;
  // Of corners that are there already, three for each triangle.
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

// 2^30 sub-voxels at 8 bits: coordinates stay integers of 32 bits, products fit in 128.
inline constexpr int kFillQMax = 1 << 30;

}  // namespace voxeld
