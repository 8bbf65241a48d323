// The words of shared/attributes.h for each triangle: what the attribute pass needs to know of its
// corners, computed once per triangle and window. Definition: README.md.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>

#include "proto/options.h"
#include "server/scene/scene.h"
#include "server/voxel/flat_colors.h"
#include "server/voxel/snap.h"
#include "server/voxel/tile_window.h"

namespace voxeld {

// Channels that are summed; their order in the sums is weight, R G B, alpha, normal X Y Z.
struct AttributeChannels {
  bool color = false;
  bool alpha = false;  // only with color: some colour is not opaque
  bool normal = false;
  uint32_t count() const {
    return 1u + (color ? 3u : 0u) + (color && alpha ? 1u : 0u) + (normal ? 3u : 0u);
  }
};

// Levels of an image that triangles sample: from the largest that the device holds to the coarsest
// that a triangle wants.
struct ImageLevels {
  int first = 16, last = -1;  // last < first: none
  bool used() const { return first <= last; }
};

class AttributeRecords {
 public:
  // All must outlive it. texture_side_max: texels; larger levels are passed over. flat: colours of
  // the same scene from an earlier frame, or null; used where the mesh is whole, as numbers of
  // triangles stay the same then.
  AttributeRecords(const Scene& scene, const SnappedMesh& mesh, const glm::dmat4& world_from_file,
                   ColorMode mode, AttributeChannels channels, int texture_side_max,
                   FlatColors* flat);
  AttributeRecords(const AttributeRecords&) = delete;
  AttributeRecords& operator=(const AttributeRecords&) = delete;

  const std::vector<ImageLevels>& image_levels() const { return image_levels_; }
  // To add levels that other frames sample.
  std::vector<ImageLevels>& image_levels() { return image_levels_; }
  // Whether a triangle has one colour, texture included.
  bool has_flat_color(uint32_t triangle) const {
    return !levels_.empty() && levels_[triangle] == kFlatLevel;
  }
  const std::array<uint16_t, 4>& flat_color(uint32_t triangle) const {
    return flat_->linear16[triangle];
  }
  // ATTRIBUTE_WORDS per triangle of the window that was filled from `triangles`.
  void fill(std::span<const uint32_t> triangles, const TileWindow& window,
            std::vector<uint32_t>& words) const;
  // The same for one triangle, whose corners q are in `order` and whose dominant axis is `axis`.
  // words: ATTRIBUTE_WORDS zeros.
  void write(uint32_t triangle, const std::array<glm::ivec3, 3>& q, int axis,
             const CornerOrder& order, std::span<uint32_t> words) const;

 private:
  static constexpr uint8_t kFlatLevel = 255;

  // Of one corner; weighted means for corners that clipping made.
  struct Corner {
    glm::dvec3 p_world{0.0}, normal_world{0.0};  // only where normals are wanted
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
  void write_normals(const MeshPart& part, Corner* corners, bool reversed, uint32_t* words) const;
  static void flatten_normals(uint32_t* words);

  const Scene& scene_;
  const SnappedMesh& mesh_;
  glm::dmat4 world_from_file_;
  glm::dmat3 world_from_file_normal_;  // inverse transpose
  bool is_mirrored_;                   // the transform turns faces inside out
  ColorMode mode_;
  AttributeChannels channels_;
  // Per SnappedMesh::triangles: the coarsest level to sample, counted from the full image, or
  // kFlatLevel. Empty where colours are no one's.
  std::vector<uint8_t> levels_;
  std::vector<ImageLevels> image_levels_;  // per image of the scene
  FlatColors own_flat_;
  FlatColors* flat_;  // of triangles with kFlatLevel
};

// The weight of a triangle whose corners q stand in one cell: its area, 4096 for a cell's face, at
// least 1. 0 where they do not.
uint32_t one_cell_weight(const std::array<glm::ivec3, 3>& q);

// Whether the scene has colours that are not opaque.
bool has_transparency(const Scene& scene);

}  // namespace voxeld
