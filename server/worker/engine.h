// What a worker keeps from one task to the next: its device, compiled programs, and the inputs that
// the next task is likely to ask for again.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "proto/options.h"
#include "proto/result.h"
#include "server/grid/grid.h"
#include "server/render/drawing_cost.h"
#include "server/scene/animated_scene.h"
#include "server/voxel/voxelize.h"
#include "server/worker/mesh_topology.h"
#include "server/worker/open_device.h"

namespace voxeld {

// Scenes above this are not kept: memory is for the task that runs.
inline constexpr size_t kCachedSceneBytesMax = size_t{512} << 20;

// What a lost worker may cost, beside the tile at work.
inline constexpr std::chrono::milliseconds kPartInterval{5000};

// A grid with what is costly to learn of it.
struct LoadedGrid {
  Grid grid;
  std::string content_hash;
};

// One of each, the last used: somebody who turns a model looks at the same grid again and again.
struct InputCache {
  std::string scene_key;                       // input hash and file name
  std::shared_ptr<const AnimatedScene> scene;  // without what moves it where nobody asked for that
  std::string topology_key;                    // of the scene
  std::optional<MeshTopology> topology;
  std::string grid_key;  // hash of the container, or of input and options for renders of a mesh
  std::shared_ptr<const LoadedGrid> grid;
  // Drawn last, where that was not the grid above but a part or a level of some grid.
  std::string picture_key;
  std::shared_ptr<const LoadedGrid> picture;
  // The grids that the renderers hold, by the same keys.
  std::string gl_resident_key, cpu_resident_key;
};

struct Engine {
  explicit Engine(OpenedDevice opened)
      : device(std::move(opened)), voxelizer(std::move(device.pipeline)) {}

  // One of the device's renderers and what it holds.
  struct ChosenRenderer {
    Renderer* renderer;
    std::string* resident_key;
    std::string_view name;  // "gl" or "cpu"
  };
  // `auto` draws on the CPU where GL would run on the same cores, only slower
  // (tests/bench/render_bench). Errors: device-unavailable for gl without a GL context.
  Result<ChosenRenderer> choose_renderer(RendererChoice asked);
  // Before each task: what is kept of another tenant's inputs goes (proto/task_api.h tells why).
  void begin_task_of(const std::string& tenant);

  OpenedDevice device;  // its pipeline has gone to the voxelizer
  Voxelizer voxelizer;
  InputCache cache;
  std::string cache_tenant;  // whose inputs the cache holds
  PictureLimits picture_limits;
  // How often the tiles of a long job that are done go to the gateway (TileParts).
  std::chrono::milliseconds part_interval = kPartInterval;
};

}  // namespace voxeld
