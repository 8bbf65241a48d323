// The time of each pass of pipeline compute beside the least that it must read and write:
//   pass_bench MESH [--device D] [--bandwidth-gbs G] [--windows] [--two-words] [--batch-tiles N]
//              [--rule R] [--repeat N] [SIZE...]
// MESH as in bench_scene.h; sizes: 256 512 1024 2048. G: memory bandwidth of the device in GB/s,
// 4300 (H200) unless told. Prints a Markdown table, one row per size and pass: medians in
// microseconds (device time where the driver has timer queries, else wall time around glFinish),
// bytes, those over the bandwidth, and the ratio. Passes run as on hardware, in batches of tiles;
// --windows: as on software drivers.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/gpu/context.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/gl/gl_pipeline.h"
#include "server/voxel/tiles/tile_mask.h"
#include "server/voxel/voxelize.h"
#include "tests/bench/bench_scene.h"

namespace voxeld::bench {
namespace {

struct Arguments {
  std::string mesh, device = "auto", rule = "touch";
  double bandwidth_gbs = 4300;
  GlTuning tuning{.batches = true};
  int repeat = 5;
  std::vector<int> sizes;
};

Result<Arguments> parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string text = argv[i];
    const auto value = [&] { return std::string(i + 1 < argc ? argv[++i] : ""); };
    if (text == "--device") {
      arguments.device = value();
    } else if (text == "--bandwidth-gbs") {
      arguments.bandwidth_gbs = std::atof(value().c_str());
    } else if (text == "--windows") {
      arguments.tuning.batches = false;
    } else if (text == "--two-words") {
      arguments.tuning.int64 = false;
    } else if (text == "--batch-tiles") {
      arguments.tuning.batch_tiles = static_cast<size_t>(std::atoi(value().c_str()));
    } else if (text == "--rule") {
      arguments.rule = value();
    } else if (text == "--repeat") {
      arguments.repeat = std::max(1, std::atoi(value().c_str()));
    } else if (arguments.mesh.empty()) {
      arguments.mesh = text;
    } else {
      arguments.sizes.push_back(std::atoi(text.c_str()));
    }
  }
  if (arguments.sizes.empty()) arguments.sizes = {256, 512, 1024, 2048};
  const bool is_well = !arguments.mesh.empty() && arguments.bandwidth_gbs > 0 &&
                       std::ranges::all_of(arguments.sizes, [](int size) { return size > 0; });
  if (is_well) return arguments;
  return Error{ErrorCode::kInvalidOption, "pass_bench MESH [options] [SIZE...]",
               "MESH: " + std::string(kSceneHelp) + "; sizes and GB/s above 0", "something else"};
}

// auto: the first device that EGL numbers, hardware where there is any; one process opens one.
Result<std::unique_ptr<gpu::Context>> open_context(const std::string& name) {
  if (name == "auto") return gpu::Context::create({gpu::DeviceKind::kEgl, 0});
  VOXELD_ASSIGN(const gpu::DeviceId device, gpu::parse_device(name));
  return gpu::Context::create(device);
}

struct Job {
  VoxelizeStats stats;  // of the last run
  uint64_t voxels = 0, bricks = 0;
  size_t vertices = 0, triangles = 0;
  int size = 0;
};

struct Traffic {
  std::string what;
  double bytes = 0;
};

// The least that a pass reads and writes, each byte once.
std::map<std::string, Traffic> traffic_of(const Job& job) {
  const double masks = static_cast<double>(job.stats.tiles) * static_cast<double>(kTileMaskBytes);
  const double mesh =
      static_cast<double>(job.vertices) * 12 + static_cast<double>(job.stats.triangles) * 16;
  const double pairs = job.stats.work.triangles * 4;
  const double items = static_cast<double>(job.stats.work_items) * 8;
  const double bricks = static_cast<double>(job.bricks);
  return {{"classify", {"masks cleared; mesh, pairs; items", masks + mesh + pairs + items}},
          {"small + large", {"items, mesh; occupied bricks r/w", items + mesh + bricks * 128}},
          {"bricks", {"masks", masks}},
          {"gather", {"occupied bricks, twice", bricks * (64 + 68)}},
          {"occupancy",
           {"items, triangles; masks cleared, bricks r/w",
            items + job.stats.work.triangles * 36 + masks + bricks * 128}}};
}

void print_row(int size, const std::string& pass, double us, const Traffic* traffic,
               double bandwidth_gbs) {
  if (traffic == nullptr) {
    std::printf("| %d | %s | %.1f | | | | |\n", size, pass.c_str(), us);
    return;
  }
  const double floor_us = traffic->bytes / bandwidth_gbs / 1e3;
  std::printf("| %d | %s | %.1f | %s | %.3f | %.2f | %.1f |\n", size, pass.c_str(), us,
              traffic->what.c_str(), traffic->bytes / 1e6, floor_us, us / floor_us);
}

void print_table(const Job& job, const std::vector<std::pair<std::string, double>>& passes_us,
                 double bandwidth_gbs) {
  const auto known = traffic_of(job);
  double device_us = 0;
  for (const auto& [pass, us] : passes_us) {
    const auto found = known.find(pass);
    if (found != known.end()) device_us += us;
    print_row(job.size, pass, us, found == known.end() ? nullptr : &found->second, bandwidth_gbs);
  }
  // As the published floors are counted: 36 bytes a triangle, the grid's bits cleared and written.
  const double cells = static_cast<double>(job.size) * job.size * job.size;
  const Traffic whole{"36 B a triangle; dense bits twice",
                      static_cast<double>(job.triangles) * 36 + cells / 4};
  print_row(job.size, "**passes on the device**", device_us, &whole, bandwidth_gbs);
  std::fflush(stdout);
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

// Medians in microseconds, in the order of the passes; small and large together, because only
// their sum of work is known.
Result<std::vector<std::pair<std::string, double>>> measure(Voxelizer& voxelizer,
                                                            const Arguments& arguments,
                                                            const Scene& scene, Job& job) {
  VOXELD_ASSIGN(const RequestOptions request,
                parse_options(OptionPairs{{"color", "none"}, {"rule", arguments.rule}},
                              OptionScope::kVoxelize));
  VoxelizeOptions options = request.voxelize;
  options.pipeline = PipelineChoice::kCompute;
  options.placement.size = job.size;
  std::vector<std::string> order;
  std::map<std::string, std::vector<double>> times;
  for (int run = 0; run <= arguments.repeat; ++run) {
    job.stats = {};
    VOXELD_ASSIGN(const Grid grid, voxelizer.voxelize(scene, options, {}, &job.stats));
    if (run == 0) continue;
    std::map<std::string, double> sums;
    for (const auto& [pass, ms] : job.stats.passes) {
      const std::string name = pass == "small" || pass == "large" ? "small + large" : pass;
      if (std::ranges::find(order, name) == order.end()) order.push_back(name);
      sums[name] += ms * 1e3;
    }
    for (const auto& [name, us] : sums) times[name].push_back(us);
    job.voxels = grid.voxel_count();
    job.bricks = 0;
    for (const SparseTile& tile : grid.tiles) job.bricks += tile.masks.size() + tile.full.size();
  }
  std::vector<std::pair<std::string, double>> medians;
  for (const std::string& name : order) medians.emplace_back(name, median(times[name]));
  return medians;
}

Status run(const Arguments& arguments) {
  VOXELD_ASSIGN(const Scene scene, bench_scene(arguments.mesh));
  VOXELD_ASSIGN(const auto context, open_context(arguments.device));
  gpu::ShaderLibrary shaders(*context);
  Voxelizer voxelizer(std::make_unique<GlPipeline>(*context, shaders, arguments.tuning));
  std::printf("%s, %zu triangles, on %s; times by %s; floors at %.0f GB/s\n\n",
              arguments.mesh.c_str(), scene.triangle_count(), context->info().renderer.c_str(),
              context->info().has_timer_queries ? "timer queries" : "wall clock",
              arguments.bandwidth_gbs);
  std::printf(
      "| size | pass | µs | bytes | MB | floor µs | ratio |\n|---|---|---|---|---|---|---|\n");
  for (const int size : arguments.sizes) {
    Job job;
    job.vertices = scene.vertex_count();
    job.triangles = scene.triangle_count();
    job.size = size;
    VOXELD_ASSIGN(const auto passes, measure(voxelizer, arguments, scene, job));
    print_table(job, passes, arguments.bandwidth_gbs);
  }
  return {};
}

int report(const Status& status, int code) {
  if (!status) std::fprintf(stderr, "%s\n", status.error().message().c_str());
  return status ? 0 : code;
}

}  // namespace
}  // namespace voxeld::bench

int main(int argc, char** argv) {
  const auto arguments = voxeld::bench::parse(argc, argv);
  if (!arguments) return voxeld::bench::report(arguments.error(), 2);
  return voxeld::bench::report(voxeld::bench::run(*arguments), 1);
}
