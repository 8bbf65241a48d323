// Counts the mesh's topology while its grid is made.
#pragma once

#include <atomic>
#include <future>
#include <optional>
#include <string>

#include "server/worker/engine.h"

namespace voxeld {

// Counts on a thread of its own from construction on, so tiles do not wait for it. Large meshes are
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

  // Waits for the count. Throws std::bad_alloc.
  const std::optional<MeshTopology>& get();

 private:
  InputCache& cache_;
  std::string key_;
  std::atomic<bool> is_unwanted_{false};
  std::future<std::optional<MeshTopology>> counted_;  // last: it waits for its thread
};

}  // namespace voxeld
