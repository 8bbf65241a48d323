#include "server/formats/mesh/surface_mesh.h"

#include "server/formats/bricks/voxel_bricks.h"
#include "server/formats/mesh/rectangle_mesh.h"
#include "server/formats/mesh/rectangles.h"
#include "server/formats/mesh/smooth_mesh.h"

namespace voxeld::mesh {

Result<SurfaceMesh> make_surface_mesh(const Grid& grid, const OutputOptions& options) {
  const std::string_view format = format_name(options.format);
  if (options.mesh == MeshSurface::kSmooth) return make_smooth_mesh(grid, format);
  const VoxelColors colors(grid);
  const VoxelBricks voxels(grid);
  const bool merge = options.mesh == MeshSurface::kGreedy;
  VOXELD_ASSIGN(const std::vector<RectangleSlab> slabs,
                find_rectangles(voxels, &colors, merge, format));
  VOXELD_ASSIGN(SurfaceMesh mesh, mesh_of_rectangles(voxels, slabs, colors.several(), format));
  mesh.has_colors = colors.several();
  return mesh;
}

}  // namespace voxeld::mesh
