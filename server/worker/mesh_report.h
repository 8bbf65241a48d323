// The mesh's topology beside the work on its grid.
#pragma once

#include <future>
#include <optional>
#include <string>

#include "server/worker/engine.h"

namespace voxeld {

// Counts on a thread of its own from construction on, so that tiles do not wait for it; large
// meshes when they are asked for, after the tiles' memory is free. What the cache has of the same
// scene is not counted again. The scene and the cache must outlive it.
class MeshReport {
 public:
  // Meshes of more triangles are not counted beside the tiles.
  static constexpr size_t kBesideTrianglesMax = 4'000'000;

  // key: of the scene, in the cache.
  MeshReport(InputCache& cache, std::string key, const Scene& scene);

  // Waits. Throws std::bad_alloc.
  const std::optional<MeshTopology>& get();

 private:
  InputCache& cache_;
  std::string key_;
  std::future<std::optional<MeshTopology>> counted_;
};

}  // namespace voxeld
