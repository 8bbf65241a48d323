#include "server/grid/grid_spec.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "proto/limits.h"
#include "proto/options/values.h"

namespace voxeld {
namespace {

// Extents beyond these overflow, or leave no precision for 1/256 of a voxel.
constexpr double kExtentMax = 1e30;
constexpr double kExtentMin = 1e-30;
constexpr double kExtentToReachMin = 1e-9;
// Smaller voxels, as a part of the largest coordinate, leave no digits for 1/4096 of one, the
// tolerance with which faces on the grid's box are snapped (voxel/triangles/snap.cpp).
constexpr double kVoxelToReachMin = 0x1p-40;
// A side that exceeds N voxels by less than this is a rounding error and gets no further cell.
constexpr double kCellTolerance = 1.0 / 4096;

Error invalid(std::string detail, std::string expected, std::string got) {
  return {ErrorCode::kInvalidOption, std::move(detail), std::move(expected), std::move(got)};
}

// Cells that cover `extent`, at least 1. The result is a double so that large numbers do not
// overflow.
double cells_for(double extent, double voxel_size) {
  return std::max(1.0, std::ceil(extent / voxel_size - kCellTolerance));
}

struct Box {
  glm::dvec3 min, max;
  glm::dvec3 extent() const { return max - min; }
  double longest() const { return std::max({extent().x, extent().y, extent().z}); }
  // The largest absolute coordinate on an axis.
  double reach(int c) const { return std::max(std::abs(min[c]), std::abs(max[c])); }
};

Result<Box> box_to_place(const PlacementOptions& options, const glm::dvec3& min,
                         const glm::dvec3& max) {
  Box box{min, max};
  if (options.bounds) {
    const auto& b = *options.bounds;
    box = {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}};
  }
  // max() ignores NaN, a sum does not.
  const glm::dvec3 extent = box.extent();
  const double longest = std::isnan(extent.x + extent.y + extent.z) ? NAN : box.longest();
  if (!std::isfinite(longest) || longest < 0 || longest > kExtentMax) {
    return invalid("extent of the box to voxelize", "a finite number of at most 1e30",
                   option_values::to_text(longest));
  }
  const double reach = std::max({box.reach(0), box.reach(1), box.reach(2)});
  if (longest > 0 && (longest < kExtentMin || longest < reach * kExtentToReachMin)) {
    return invalid("the mesh is too small for its distance from the origin to be placed exactly",
                   "an extent of at least a billionth of its largest coordinate",
                   option_values::to_text(longest) + " at " + option_values::to_text(reach));
  }
  return box;
}

// Centres the box in the grid.
GridSpec centred(const Box& box, const glm::dvec3& cells, const glm::dvec3& voxel_size) {
  GridSpec spec;
  spec.dims = glm::ivec3(cells);
  spec.voxel_size = voxel_size;
  spec.origin_world = (box.min + box.max) * 0.5 - cells * voxel_size * 0.5;
  return spec;
}

Result<GridSpec> checked(const Box& box, const glm::dvec3& cells, const glm::dvec3& voxel_size) {
  constexpr double kMax = limits::kGridSideMax;
  if (cells.x > kMax || cells.y > kMax || cells.z > kMax) {
    const auto count = [](double v) {
      return v < 1e15 ? std::to_string(static_cast<int64_t>(v)) : std::string("over 1e15");
    };
    return Error{ErrorCode::kGridTooLarge, "grid dims",
                 "at most " + std::to_string(limits::kGridSideMax) + " cells on a side",
                 count(cells.x) + " x " + count(cells.y) + " x " + count(cells.z)};
  }
  for (int c = 0; c < 3; ++c) {
    if (!(box.extent()[c] > 0) || voxel_size[c] >= box.reach(c) * kVoxelToReachMin) continue;
    return invalid(
        "voxels are too small for their distance from the origin to be placed exactly",
        "at least 2^-40 of the largest coordinate",
        option_values::to_text(voxel_size[c]) + " at " + option_values::to_text(box.reach(c)));
  }
  return centred(box, cells, voxel_size);
}

Result<GridSpec> place_by_size(const Box& box, int size, double padding) {
  const double longest = box.longest();
  const double inner = size - 2 * padding;
  const double voxel = longest > 0 ? longest / inner : 1.0;
  glm::dvec3 cells;
  for (int c = 0; c < 3; ++c) {
    // The longest side has N cells by definition; a division could round.
    cells[c] = (box.extent()[c] == longest && longest > 0
                    ? inner
                    : std::min(inner, cells_for(box.extent()[c], voxel))) +
               2 * padding;
  }
  return checked(box, cells, glm::dvec3(voxel));
}

Result<GridSpec> place_by_dims(const Box& box, const std::array<int, 3>& dims, double padding,
                               bool exact_box) {
  const glm::dvec3 cells(dims[0], dims[1], dims[2]);
  const glm::dvec3 inner = cells - 2 * padding;
  if (inner.x < 1 || inner.y < 1 || inner.z < 1) {
    return invalid("padding", "less than half of each of dims",
                   std::to_string(static_cast<int>(padding)));
  }
  const glm::dvec3 extent = box.extent();
  // Without an exact box, the longest side decides the voxel size.
  for (int c = 0; exact_box && c < 3; ++c) {
    if (extent[c] < std::max(kExtentMin, box.reach(c) * kExtentToReachMin)) {
      return invalid(
          "bounds", "sides of at least a billionth of their largest coordinate",
          option_values::to_text(extent[c]) + " at " + option_values::to_text(box.reach(c)));
    }
  }
  glm::dvec3 voxel = extent / inner;
  if (!exact_box) voxel = glm::dvec3(std::max({voxel.x, voxel.y, voxel.z}));
  for (int c = 0; c < 3; ++c) {
    if (!(voxel[c] > 0)) voxel[c] = 1.0;
  }
  return checked(box, cells, voxel);
}

Result<GridSpec> place_by_voxel_size(const Box& box, const std::array<double, 3>& size,
                                     double padding) {
  const glm::dvec3 voxel(size[0], size[1], size[2]);
  const double largest = std::ranges::max(size);
  if (largest > kExtentMax) {
    return invalid("voxel_size", "at most 1e30", option_values::to_text(largest));
  }
  glm::dvec3 cells;
  for (int c = 0; c < 3; ++c) cells[c] = cells_for(box.extent()[c], voxel[c]) + 2 * padding;
  return checked(box, cells, voxel);
}

}  // namespace

glm::ivec3 GridSpec::tile_dims() const {
  return (dims + limits::kTileSide - 1) / limits::kTileSide;
}

glm::dmat4 world_from_file(const PlacementOptions& options) {
  glm::dmat4 world_from_turned(1.0);
  if (options.transform) {
    for (int row = 0; row < 4; ++row) {
      for (int column = 0; column < 4; ++column) {
        world_from_turned[column][row] =
            (*options.transform)[4 * static_cast<size_t>(row) + static_cast<size_t>(column)];
      }
    }
  }
  glm::dmat4 turned_from_file(1.0);
  if (options.up == UpAxis::kZ) {
    // (x, y, z) -> (x, z, -y)
    turned_from_file = glm::dmat4(1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1);
  }
  return world_from_turned * turned_from_file;
}

Result<GridSpec> place_grid(const PlacementOptions& options, const glm::dvec3& bounds_min,
                            const glm::dvec3& bounds_max) {
  VOXELD_ASSIGN(const Box box, box_to_place(options, bounds_min, bounds_max));
  const double padding = options.padding;
  if (options.dims) {
    return place_by_dims(box, *options.dims, padding, options.bounds.has_value());
  }
  if (options.voxel_size) return place_by_voxel_size(box, *options.voxel_size, padding);
  const int size = options.size.value_or(kDefaultSize);
  if (2 * options.padding >= size) {
    return invalid("padding", "less than half of size " + std::to_string(size),
                   std::to_string(options.padding));
  }
  return place_by_size(box, size, padding);
}

}  // namespace voxeld
