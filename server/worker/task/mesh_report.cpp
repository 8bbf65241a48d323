#include "server/worker/task/mesh_report.h"

#include <thread>
#include <utility>

#include "server/base/cancel_point.h"

namespace voxeld {

MeshReport::MeshReport(InputCache& cache, std::string key, const Scene& scene)
    : cache_(cache), key_(std::move(key)), scene_(scene) {
  is_beside_ = cache_.topology_key != key_ && scene.triangle_count() <= kBesideTrianglesMax;
  if (!is_beside_) return;
  (void)beside_.push(0, [this, task = std::this_thread::get_id()]() -> Status {
    if (std::this_thread::get_id() == task) {  // get() did not find it begun
      counted_ = mesh_topology(scene_);
      return {};
    }
    const CancelScope scope(is_unwanted_);
    counted_ = mesh_topology(scene_);
    return {};
  });
}

const std::optional<MeshTopology>& MeshReport::get() {
  if (cache_.topology_key == key_) return cache_.topology;
  if (is_beside_) {
    (void)beside_.wait().ok();  // a count has no errors
  } else {
    counted_ = mesh_topology(scene_);
  }
  cache_.topology = counted_;
  cache_.topology_key = key_;
  return cache_.topology;
}

}  // namespace voxeld
