#include "tests/gpu/render/hits_check.h"

#include <gtest/gtest.h>

#include "server/render/raymarch_params.h"
#include "tests/gpu/render/test_renderer.h"

namespace voxeld {
namespace {

// Rays that may differ for it: an edge band of 1e-3 on some 30 cells that a ray passes would be 3%;
// what is measured is below 0.05%.
constexpr double kTiesMax = 0.002;

// Both results are right: the ray only grazes the cell that one of them hit.
bool is_tie(const OracleRay& ray, const Hit& wanted, const Hit& got, double edge) {
  if (wanted.cell == got.cell) return chord(ray, got.cell, edge) > 0;  // through an edge: the face
  if (wanted.face >= 0 && chord(ray, wanted.cell, 0) < edge) return true;
  return got.face >= 0 && chord(ray, got.cell, 0) < edge && chord(ray, got.cell, edge) > 0;
}

}  // namespace

Renderer& hits_renderer() {
  static const std::unique_ptr<Renderer> one = make_test_renderer();
  return *one;
}

std::string text(const Hit& hit) {
  return std::to_string(hit.cell.x) + "," + std::to_string(hit.cell.y) + "," +
         std::to_string(hit.cell.z) + " face " + std::to_string(hit.face);
}

int expect_same_hits(const RenderOptions& options, const Grid& grid, double edge_cells) {
  return expect_same_hits(options, grid, OracleGrid(grid), edge_cells);
}

int expect_same_hits(const RenderOptions& options, const Grid& grid, const OracleGrid& oracle,
                     double edge_cells) {
  const auto hits = hits_renderer().render_hits(options);
  EXPECT_TRUE(hits.ok()) << hits.error().message();
  if (!hits.ok()) return 0;
  // Framing has tests of its own (unit/render); here the ray of a pixel is given.
  const auto packed = pack_grid(grid);
  EXPECT_TRUE(packed.ok());
  const Camera camera = make_camera(options, subject_of(*packed));
  int ties = 0, hit_count = 0, wrong = 0;
  for (int y = 0; y < options.height; ++y) {
    for (int x = 0; x < options.width; ++x) {
      const OracleRay ray = oracle_ray(options, camera.clip_from_world, grid.spec, x, y);
      const Hit wanted = oracle.march(ray);
      const Hit& got = (*hits)[static_cast<size_t>(y * options.width + x)];
      hit_count += got.face >= 0;
      if (wanted.cell == got.cell && wanted.face == got.face) continue;
      if (is_tie(ray, wanted, got, edge_cells)) {
        ++ties;
      } else if (++wrong <= 3) {
        ADD_FAILURE() << "pixel " << x << "," << y << ": expected " << text(wanted) << ", got "
                      << text(got);
      }
    }
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_LE(ties, kTiesMax * options.width * options.height + 2);
  return hit_count;
}

GridSpec spec_of(const glm::ivec3& dims, const glm::dvec3& voxel_size) {
  GridSpec spec;
  spec.dims = dims;
  spec.voxel_size = voxel_size;
  spec.origin_world = {-3.5, 100.25, 7.0};
  return spec;
}

RenderOptions options_of(int width, int height, double azimuth, double elevation) {
  RenderOptions options = plain_options(Style::kSmooth, width, height);
  options.azimuth_deg = azimuth;
  options.elevation_deg = elevation;
  return options;
}

}  // namespace voxeld
