// The state that a worker keeps from one task to the next: its device, compiled programs, and the
// inputs that the next task is likely to use again.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/grid/grid.h"
#include "server/render/drawing_cost.h"
#include "server/scene/core/animated_scene.h"
#include "server/voxel/pipelines/device_faults.h"
#include "server/voxel/voxelize.h"
#include "server/worker/device/open_device.h"
#include "server/worker/mesh/mesh_topology.h"

namespace voxeld {

// Larger scenes are not cached: memory is for the running task.
inline constexpr size_t kCachedSceneBytesMax = size_t{512} << 20;

// The most work, beside the current tile, that a lost worker may cost.
inline constexpr std::chrono::milliseconds kPartInterval{5000};

// A grid with its content hash, which is costly to compute.
struct LoadedGrid {
  Grid grid;
  std::string content_hash;
  int level = 0;  // of detail
};

// The last used input of each kind. A client that turns a model requests the same grid again and
// again.
struct InputCache {
  std::string scene_key;                       // input hash and file name
  std::shared_ptr<const AnimatedScene> scene;  // without its rig if no task needed that
  std::string topology_key;                    // of the scene
  std::optional<MeshTopology> topology;
  std::string grid_key;  // hash of the container, or of input and options for renders of a mesh
  std::shared_ptr<const LoadedGrid> grid;
  // The grid drawn last, if it was not the one above but a part or a level of some grid.
  std::string image_key;
  std::shared_ptr<const LoadedGrid> image;
  std::string too_large_key;  // of the last one that was tried and did not fit
  // The grids that the renderers hold, by the same keys.
  std::string gl_resident_key, cpu_resident_key;
};

struct Engine {
  explicit Engine(OpenedDevice opened)
      : device(std::move(opened)), voxelizer(std::move(device.pipeline)) {}

  // One of the device's renderers and the grid it holds.
  struct ChosenRenderer {
    Renderer* renderer;
    std::string* resident_key;
    std::string_view name;  // "gl" or "cpu"
  };
  // `auto` draws on the CPU if GL would run on the same cores, only slower
  // (tests/bench/render_bench), or if the device failed its self-test. Errors: unsupported-feature
  // for gl without a GL context or after such a failure.
  Result<ChosenRenderer> choose_renderer(RendererChoice asked);
  // Records how a job went that the device had a part in: its failure, in whose place the CPU went
  // on, or empty.
  void note_device(std::string failure) { device_failure = std::move(failure); }
  // Leaves the faulty parts of the device unused.
  void set_device_faults(const DeviceFaults& faults);
  // Call before each task: drops the cached inputs of another tenant (proto/messages/task_api.h
  // tells why).
  void begin_task_of(const std::string& tenant);

  OpenedDevice device;  // its pipeline was moved to the voxelizer
  Voxelizer voxelizer;
  InputCache cache;
  std::string cache_tenant;  // the owner of the cached inputs
  ImageLimits image_limits;
  std::string device_failure;  // as of the last note_device()
  DeviceFaults device_faults;  // of the self-test, as the voxelizer has them
  // How often finished tiles of a long job are handed to the gateway (TileParts).
  std::chrono::milliseconds part_interval = kPartInterval;
};

}  // namespace voxeld
