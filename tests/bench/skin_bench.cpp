// Frames of an animated mesh by pipeline compute in batches, as hardware runs it, with vertices
// moved by the CPU and by the device:
//   skin_bench FILE [--device D] [--size N] [--frames N] [--color MODE]
// FILE: a zip, or one file; sizes: 128 unless told; MODE as in a request, none unless told. Prints
// frames per second, the time of each pass and the bytes that were uploaded of the mesh, all per
// frame and without the first three, and whether all grids were equal. As in the daemon, the next
// frame's pose, and its vertices where the CPU moves them, are made beside this frame's voxels.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "server/base/clock.h"
#include "server/base/disk/file.h"
#include "server/gpu/context.h"
#include "server/gpu/shader_library.h"
#include "server/grid/content_hash.h"
#include "server/scene/core/animated_scene.h"
#include "server/scene/load.h"
#include "server/voxel/gl/gl_pipeline.h"
#include "server/voxel/voxelize.h"

namespace voxeld {
namespace {

// Frames that find out how the others go.
constexpr size_t kWarmFrames = 3;

struct Arguments {
  std::string file, device = "auto", color = "none";
  int size = 128;
  size_t frames = 48;
};

Result<Arguments> parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string text = argv[i];
    const auto value = [&] { return std::string(i + 1 < argc ? argv[++i] : ""); };
    if (text == "--device") {
      arguments.device = value();
    } else if (text == "--size") {
      arguments.size = std::max(1, std::atoi(value().c_str()));
    } else if (text == "--frames") {
      arguments.frames = static_cast<size_t>(std::max(1, std::atoi(value().c_str())));
    } else if (text == "--color") {
      arguments.color = value();
    } else {
      arguments.file = text;
    }
  }
  if (!arguments.file.empty()) return arguments;
  return Error{ErrorCode::kInvalidOption, "skin_bench FILE [options]", "an animated mesh", ""};
}

Result<std::unique_ptr<gpu::Context>> open_context(const std::string& name) {
  if (name == "auto") return gpu::Context::create({gpu::DeviceKind::kEgl, 0});
  VOXELD_ASSIGN(const gpu::DeviceId device, gpu::parse_device(name));
  return gpu::Context::create(device);
}

struct Clip {
  AnimatedScene animated;
  std::vector<double> times_s;
  VoxelizeOptions options;
  GridSpec spec;
};

Result<Clip> open_clip(const Arguments& arguments) {
  Clip clip;
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(arguments.file));
  VOXELD_ASSIGN(clip.animated, load_animated_scene(arguments.file, file.bytes()));
  if (clip.animated.animations.empty()) {
    return Error{ErrorCode::kInvalidOption, arguments.file, "an animation", "none"};
  }
  VOXELD_ASSIGN(const RequestOptions request,
                parse_options({{"color", arguments.color}}, OptionScope::kVoxelize));
  clip.options = request.voxelize;
  clip.options.pipeline = PipelineChoice::kCompute;
  clip.options.placement.size = arguments.size;
  const AnimationInfo& info = clip.animated.animations[0];
  const double fps = info.frame_rate > 0 ? info.frame_rate : 24;
  const auto last = static_cast<size_t>(std::floor(info.duration_s * fps + 1e-6));
  for (size_t k = 0; k < arguments.frames; ++k) {
    clip.times_s.push_back(static_cast<double>(k % (last + 1)) / fps);
  }
  VOXELD_ASSIGN(const Box3d box, bounds_over(clip.animated, 0, clip.times_s, RootMotion::kKeep));
  VOXELD_ASSIGN(clip.spec, place_grid(clip.options.placement, box.min, box.max));
  return clip;
}

struct Prepared {
  Pose pose;
  FrameVertices vertices;
  bool has_vertices = false;
};

Result<Prepared> prepare(const Clip& clip, size_t frame, bool has_vertices) {
  Prepared prepared;
  prepared.has_vertices = has_vertices;
  VOXELD_ASSIGN(prepared.pose, pose_at(clip.animated, 0, clip.times_s[frame]));
  if (!has_vertices) return prepared;
  VOXELD_TRY(
      skin_vertices(clip.animated.skin, clip.animated.scene, prepared.pose, prepared.vertices));
  return prepared;
}

struct Run {
  VoxelizeStats stats;  // of all frames but the warm ones
  double ms = 0;        // of those: waiting for their poses, and voxelizing
  std::vector<std::string> hashes;
};

class HashSink final : public TileSink {
 public:
  Status begin(const Grid& grid) override {
    grid_ = grid;
    return {};
  }
  Status add(std::vector<SparseTile> tiles) override {
    for (SparseTile& tile : tiles) grid_.tiles.push_back(std::move(tile));
    return {};
  }
  bool keeps_tiles() const override { return false; }
  std::string hash() const { return content_hash(grid_); }

 private:
  Grid grid_;
};

Result<Run> run_frames(gpu::Context& context, Clip& clip, bool by_device) {
  gpu::ShaderLibrary shaders(context);
  Voxelizer voxelizer(std::make_unique<GlPipeline>(
      context, shaders,
      GlTuning{.batches = true, .float64 = by_device ? std::optional<bool>() : false}));
  SharedFrames shared(clip.spec);
  Scene scene = clip.animated.scene;
  Run run;
  const auto later = [&](size_t frame) {
    return std::async(std::launch::async, prepare, std::cref(clip), frame, !shared.device_moves());
  };
  auto next = later(0);
  for (size_t frame = 0; frame < clip.times_s.size(); ++frame) {
    const Stopwatch watch;
    VOXELD_ASSIGN(Prepared now, next.get());
    if (now.has_vertices) swap_vertices(now.vertices, scene);
    shared.set_pose({&clip.animated.skin, &now.pose, &scene, now.has_vertices});
    if (frame + 1 < clip.times_s.size()) next = later(frame + 1);
    if (frame == kWarmFrames) run.stats = {};
    HashSink sink;
    VOXELD_TRY(voxelizer.voxelize(scene, clip.options, &shared, sink, {}, &run.stats));
    if (frame >= kWarmFrames) run.ms += watch.ms();
    run.hashes.push_back(sink.hash());
  }
  voxelizer.end_frames();
  return run;
}

void print(const char* name, const Run& run, size_t frames) {
  const auto count = static_cast<double>(frames > kWarmFrames ? frames - kWarmFrames : 1);
  std::printf("%-22s %8.1f frames/s, %9.0f bytes of mesh uploaded; µs:", name, count * 1e3 / run.ms,
              static_cast<double>(run.stats.mesh_bytes_uploaded) / count);
  for (const auto& [pass, ms] : run.stats.passes) {
    std::printf(" %s %.1f", pass.c_str(), ms * 1e3 / count);
  }
  std::printf("\n");
}

Status run(const Arguments& arguments) {
  VOXELD_ASSIGN(Clip clip, open_clip(arguments));
  VOXELD_ASSIGN(const auto context, open_context(arguments.device));
  const SkinTable& table = clip.animated.skin;
  std::printf("%s: %zu vertices, %zu triangles, %zu influences; %d x %d x %d; on %s; times by %s\n",
              arguments.file.c_str(), table.vertex_count(), clip.animated.scene.triangle_count(),
              table.influences.size(), clip.spec.dims.x, clip.spec.dims.y, clip.spec.dims.z,
              context->info().renderer.c_str(),
              context->info().has_timer_queries ? "timer queries" : "wall clock");
  const size_t frames = clip.times_s.size();
  VOXELD_ASSIGN(const Run by_cpu, run_frames(*context, clip, false));
  print("vertices by the CPU", by_cpu, frames);
  VOXELD_ASSIGN(const Run by_device, run_frames(*context, clip, true));
  print("vertices by the device", by_device, frames);
  std::printf("grids are %s\n", by_cpu.hashes == by_device.hashes ? "equal" : "NOT EQUAL");
  return {};
}

int report(const Status& status, int code) {
  if (!status) std::fprintf(stderr, "%s\n", status.error().message().c_str());
  return status ? 0 : code;
}

}  // namespace
}  // namespace voxeld

int main(int argc, char** argv) {
  const auto arguments = voxeld::parse(argc, argv);
  if (!arguments) return voxeld::report(arguments.error(), 2);
  return voxeld::report(voxeld::run(*arguments), 1);
}
