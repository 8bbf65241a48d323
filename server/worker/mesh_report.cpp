#include "server/worker/mesh_report.h"

#include <thread>
#include <utility>

#include "server/base/cancel_point.h"

namespace voxeld {

MeshReport::MeshReport(InputCache& cache, std::string key, const Scene& scene)
    : cache_(cache), key_(std::move(key)) {
  if (cache_.topology_key == key_) return;
  // If no thread is available, `deferred` counts on the calling one.
  const auto when = scene.triangle_count() > kBesideTrianglesMax
                        ? std::launch::deferred
                        : std::launch::async | std::launch::deferred;
  counted_ = std::async(when, [this, &scene, task = std::this_thread::get_id()] {
    if (std::this_thread::get_id() == task) return mesh_topology(scene);  // deferred
    const CancelScope scope(is_unwanted_);
    return mesh_topology(scene);
  });
}

const std::optional<MeshTopology>& MeshReport::get() {
  if (counted_.valid()) {
    cache_.topology = counted_.get();
    cache_.topology_key = key_;
  }
  return cache_.topology;
}

}  // namespace voxeld
