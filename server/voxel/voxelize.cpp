#include "server/voxel/voxelize.h"

#include "server/voxel/estimate.h"
#include "server/voxel/voxelize_job.h"

namespace voxeld {

struct Voxelizer::Impl {
  VoxelizerState state;
};

std::string_view pipeline_name(Pipeline pipeline) {
  return pipeline == Pipeline::kRaster ? "raster" : "compute";
}

Voxelizer::Voxelizer(gpu::Context& context, gpu::ShaderLibrary& shaders)
    : impl_(new Impl{VoxelizerState(context, shaders)}) {}
Voxelizer::~Voxelizer() = default;

Result<Grid> Voxelizer::voxelize(const Scene& scene, const VoxelizeOptions& options,
                                 const TileProgress& progress, VoxelizeStats* stats) {
  VoxelizeStats unwanted;
  auto grid =
      VoxelizeJob(impl_->state, scene, options, progress, stats != nullptr ? *stats : unwanted)
          .run();
  impl_->state.attributes.end_job();
  return grid;
}

Result<VoxelizeEstimate> Voxelizer::estimate(const Scene& scene,
                                             const VoxelizeOptions& options) const {
  VOXELD_ASSIGN(const Placed placed, place_scene(scene, options));
  const VoxelizerState& state = impl_->state;
  VOXELD_TRY(check_host_bytes(placed.spec, mesh_bytes(scene), state.host_bytes_max));
  VOXELD_ASSIGN(const SnappedMesh mesh, snap_scene(scene, placed.world_from_file, placed.spec));
  const WantedChannels channels = wanted_channels(scene, options);
  VoxelizeEstimate estimate;
  estimate.spec = placed.spec;
  estimate.tiles = static_cast<int64_t>(TileBins(mesh, placed.spec.tile_dims()).bins().size());
  estimate.device_bytes = device_bytes(scene, channels, state.context->info().ssbo_bytes_max);
  estimate.host_bytes = mesh_bytes(scene) + result_bytes(mesh, placed.spec, channels);
  VOXELD_TRY(check_host_bytes(placed.spec, estimate.host_bytes, state.host_bytes_max));
  return estimate;
}

void Voxelizer::set_host_bytes_max(int64_t bytes) {
  impl_->state.host_bytes_max = bytes;
}

}  // namespace voxeld
