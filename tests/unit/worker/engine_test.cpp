#include "server/worker/task/engine.h"

#include <gtest/gtest.h>

#include <string>

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

}  // namespace
}  // namespace voxeld
