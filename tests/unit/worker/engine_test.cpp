#include "server/worker/task/engine.h"

#include <gtest/gtest.h>

#include <string>

#include "server/worker/grids/grid_meta.h"

namespace voxeld {
namespace {

TEST(Engine, cached_inputs_of_one_tenant_do_not_serve_another) {
  Engine engine(open_device(gpu::DeviceId{.kind = gpu::DeviceKind::kCpu}, "").value());
  const auto fill = [&] {
    InputCache& cache = engine.cache;
    cache.scene_key = cache.topology_key = cache.grid_key = cache.image_key = "key";
    cache.gl_resident_key = cache.cpu_resident_key = "key";
    cache.scene = std::make_shared<const AnimatedScene>();
    cache.topology.emplace();
    cache.grid = cache.image = std::make_shared<const LoadedGrid>();
  };
  const auto is_kept = [&] {
    const InputCache& cache = engine.cache;
    const bool has_keys = !(cache.scene_key + cache.topology_key + cache.grid_key +
                            cache.image_key + cache.gl_resident_key + cache.cpu_resident_key)
                               .empty();
    return has_keys || cache.scene || cache.topology || cache.grid || cache.image;
  };
  fill();
  engine.begin_task_of("");
  EXPECT_TRUE(is_kept());
  engine.begin_task_of("lab");
  EXPECT_FALSE(is_kept());
  fill();
  engine.begin_task_of("lab");
  EXPECT_TRUE(is_kept());
  engine.begin_task_of("studio");
  EXPECT_FALSE(is_kept());
}

TEST(Engine, only_a_job_that_works_on_the_device_ends_its_failure) {
  Engine engine(open_device(gpu::DeviceId{.kind = gpu::DeviceKind::kCpu}, "").value());
  VoxelizeStats failed;
  failed.pipeline = Pipeline::kCpu;
  failed.device_failure = "no memory";
  note_device(engine, failed, {});
  EXPECT_EQ(engine.device_failure, "no memory");
  note_device(engine, {}, Error{ErrorCode::kGridTooLarge, "grid dims", "", ""});
  EXPECT_EQ(engine.device_failure, "no memory") << "it failed before a pipeline was chosen";
  VoxelizeStats by_cpu;
  by_cpu.pipeline = Pipeline::kCpu;
  note_device(engine, by_cpu, {});
  EXPECT_EQ(engine.device_failure, "no memory");
  VoxelizeStats by_device;
  by_device.pipeline = Pipeline::kCompute;
  note_device(engine, by_device, {});
  EXPECT_EQ(engine.device_failure, "");
}

}  // namespace
}  // namespace voxeld
