// Attribute words of each triangle (shared/attributes.h): the corner values that the attribute pass
// reads. They are computed once per triangle and window. README.md defines them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>

#include "proto/options/options.h"
#include "server/scene/core/scene.h"
#include "server/voxel/attributes/flat_colors.h"
#include "server/voxel/triangles/snap.h"
#include "server/voxel/triangles/tile_window.h"

namespace voxeld {

// Channels that are summed. Their order in the sums is weight, R G B, alpha, normal X Y Z.
struct AttributeChannels {
  bool color = false;
  bool alpha = false;  // only with color: at least one colour is not opaque
  bool normal = false;
  uint32_t count() const {
    return 1u + (color ? 3u : 0u) + (color && alpha ? 1u : 0u) + (normal ? 3u : 0u);
  }
};

// Mip levels of an image that triangles sample: from the largest that the device can hold to the
// coarsest that a triangle needs.
struct ImageLevels {
  int first = 16, last = -1;  // last < first: none
  bool used() const { return first <= last; }
};

class AttributeRecords {
 public:
  // All arguments must outlive this object. texture_side_max is in texels; larger levels are
  // skipped. flat: colours of the same scene from an earlier frame, or null. They are used only if
  // the mesh is whole, because only then do triangles keep their numbers.
  AttributeRecords(const Scene& scene, const SnappedMesh& mesh, const glm::dmat4& world_from_file,
                   ColorMode mode, AttributeChannels channels, int texture_side_max,
                   FlatColors* flat);
  AttributeRecords(const AttributeRecords&) = delete;
  AttributeRecords& operator=(const AttributeRecords&) = delete;

  const std::vector<ImageLevels>& image_levels() const { return image_levels_; }
  // Mutable, so that levels which other frames sample can be added.
  std::vector<ImageLevels>& image_levels() { return image_levels_; }
  // True if the triangle has a single colour, texture included.
  bool has_flat_color(uint32_t triangle) const {
    return !levels_.empty() && levels_[triangle] == kFlatLevel;
  }
  const std::array<uint16_t, 4>& flat_color(uint32_t triangle) const {
    return flat_->linear16[triangle];
  }
  // Writes ATTRIBUTE_WORDS per triangle of the window that was filled from `triangles`.
  void fill(std::span<const uint32_t> triangles, const TileWindow& window,
            std::vector<uint32_t>& words) const;
  // Writes the words of one triangle. Its corners q are in `order`; its dominant axis is `axis`.
  // words: ATTRIBUTE_WORDS zeros.
  void write(uint32_t triangle, const std::array<glm::ivec3, 3>& q, int axis,
             const CornerOrder& order, std::span<uint32_t> words) const;

 private:
  static constexpr uint8_t kFlatLevel = 255;

  // The attributes of one corner. Corners that clipping made have weighted means.
  struct Corner {
    glm::dvec3 p_world{0.0}, normal_world{0.0};  // set only if normals are wanted
    glm::dvec4 color{1.0};
    glm::dvec2 uv{0.0};
  };
  Corner corner_of(const MeshPart& part, uint32_t first_vertex, uint32_t vertex) const;
  Corner file_corner(const MeshPart& part, uint32_t index) const;
  static void merge_equal(const std::array<glm::ivec3, 3>& q, std::array<Corner, 3>& corners);
  void find_levels(int texture_side_max);
  std::array<Corner, 3> corners_of(const SnappedTriangle& triangle, const CornerOrder& order) const;
  int level_of(const SnappedTriangle& triangle, const Image& image) const;
  void find_flat_color(uint32_t triangle);
  static void write_geometry(const std::array<glm::ivec3, 3>& q, int axis, uint32_t* words);
  void write_colors(const MeshPart& part, const Corner* corners, int axis, uint32_t* words) const;
  void write_flat_color(uint32_t triangle, uint32_t* words) const;
  void write_uvs(const Material& material, const Corner* corners, int level, uint32_t* words) const;
  void write_normals(const MeshPart& part, const Corner* corners, bool reversed,
                     uint32_t* words) const;
  static void flatten_normals(uint32_t* words);

  const Scene& scene_;
  const SnappedMesh& mesh_;
  glm::dmat4 world_from_file_;
  glm::dmat3 world_from_file_normal_;  // inverse transpose
  bool is_mirrored_;                   // the transform turns faces inside out
  ColorMode mode_;
  AttributeChannels channels_;
  // Coarsest level to sample, counted from the full image, or kFlatLevel; one per
  // SnappedMesh::triangles. Empty if colours are not wanted.
  std::vector<uint8_t> levels_;
  std::vector<ImageLevels> image_levels_;  // per image of the scene
  FlatColors own_flat_;
  FlatColors* flat_;  // colours of the triangles with kFlatLevel
};

// The weight of a triangle whose corners q all lie in one cell: its area, at least 1. The face of a
// cell counts 4096. Returns 0 if the corners lie in several cells.
uint32_t one_cell_weight(const std::array<glm::ivec3, 3>& q);

// True if any colour of the scene is not opaque.
bool has_transparency(const Scene& scene);

}  // namespace voxeld
