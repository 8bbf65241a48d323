// Counts the mesh's topology while its grid is made.
#pragma once

#include <atomic>
#include <optional>
#include <string>

#include "server/worker/task/engine.h"
#include "server/worker/task/serial_queue.h"

namespace voxeld {

// Counts on another thread from construction on, so tiles do not wait for it. Large meshes are
// counted only when asked for, after the tiles' memory is free. A count that the cache has for the
// same scene is reused. The scene and the cache must outlive it.
class MeshReport {
 public:
  // Meshes with more triangles are not counted beside the tiles.
  static constexpr size_t kBesideTrianglesMax = 4'000'000;

  // key: of the scene, in the cache.
  MeshReport(InputCache& cache, std::string key, const Scene& scene);
  // Stops the count if it was not asked for.
  ~MeshReport() { is_unwanted_ = true; }
  MeshReport(const MeshReport&) = delete;
  MeshReport& operator=(const MeshReport&) = delete;

  // Waits for the count, or makes it. Throws std::bad_alloc and Cancelled (cancel_point.h).
  const std::optional<MeshTopology>& get();

 private:
  InputCache& cache_;
  const std::string key_;
  const Scene& scene_;
  bool is_beside_ = false;
  std::optional<MeshTopology> counted_;  // if is_beside_
  std::atomic<bool> is_unwanted_{false};
  SerialQueue beside_{0};  // last: it waits for the count that runs
};

}  // namespace voxeld
