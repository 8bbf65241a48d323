#include "server/worker/images/image_view.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>

#include "server/base/check.h"
#include "server/grid/level.h"
#include "server/render/raymarch_params.h"

namespace voxeld {
namespace {

constexpr int kCorners = 8;

glm::dvec4 corner(const CellBox& cells, int i) {
  return {(i & 1) != 0 ? cells.max.x : cells.min.x, (i & 2) != 0 ? cells.max.y : cells.min.y,
          (i & 4) != 0 ? cells.max.z : cells.min.z, 1.0};
}

glm::dmat4 from_row_major(const std::array<double, 16>& rows) {
  glm::dmat4 matrix;
  for (size_t i = 0; i < rows.size(); ++i) {
    matrix[static_cast<int>(i % 4)][static_cast<int>(i / 4)] = rows[i];
  }
  return matrix;
}

}  // namespace

ImageView::ImageView(const RenderOptions& options, const GridSpec& spec)
    : half_width_(0.5 * options.width), half_height_(0.5 * options.height) {
  VOXELD_CHECK(options.matrix.has_value(), "a view has its camera");
  clip_from_grid_ = from_row_major(*options.matrix) *
                    glm::scale(glm::translate(glm::dmat4(1.0), spec.origin_world), spec.voxel_size);
  if (options.section) section_ = section_in_grid(*options.section, spec);
}

bool ImageView::sees(const CellBox& cells) const {
  // For each plane, whether some corner is on its inner side. That suffices because a box is
  // convex. A half space in clip coordinates is one in the world, whatever the sign of w.
  std::array<bool, 7> inside{};
  for (int i = 0; i < kCorners; ++i) {
    const glm::dvec4 at = corner(cells, i);
    const glm::dvec4 clip = clip_from_grid_ * at;
    for (int c = 0; c < 3; ++c) {
      const size_t plane = size_t{2} * static_cast<size_t>(c);
      inside[plane] = inside[plane] || clip[c] >= -clip.w;
      inside[plane + 1] = inside[plane + 1] || clip[c] <= clip.w;
    }
    inside[6] = inside[6] || !section_ || glm::dot(*section_, at) <= 0;
  }
  return std::ranges::all_of(inside, [](bool one) { return one; });
}

double ImageView::cell_pixels(const CellBox& cells) const {
  double most = 0;
  for (int i = 0; i < kCorners; ++i) {
    const glm::dvec4 clip = clip_from_grid_ * corner(cells, i);
    if (!(clip.w > 0)) return std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
      // The derivatives of x/w and y/w along the axis.
      const glm::dvec4 step = clip_from_grid_[axis];
      const double scale = 1.0 / (clip.w * clip.w);
      const double x = (step.x * clip.w - clip.x * step.w) * scale * half_width_;
      const double y = (step.y * clip.w - clip.y * step.w) * scale * half_height_;
      most = std::max(most, std::hypot(x, y));
    }
  }
  return most;
}

int level_of_pixels(double cell_pixels) {
  int level = 0;
  while (level < kLevelMax && std::ldexp(cell_pixels, level + 1) <= kLevelPixelsMax) ++level;
  return level;
}

}  // namespace voxeld
