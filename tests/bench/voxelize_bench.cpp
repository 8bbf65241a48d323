// Times the pipelines on one mesh, from the scene in memory to its sparse grid:
//   voxelize_bench MESH [--device D] [--pipeline P] [--isa I] [--threads N] [--shuffle SEED]
//                  [--NAME VALUE]... [--normal] [--repeat N] [--hash] [--json FILE]
//                  [--shader-dir DIR] SIZE...
// MESH as in bench_scene.h; --NAME VALUE is any option of a request (--rule thin, --color shaded).
// Prints one line per pipeline and size: median of the runs in milliseconds, whole and by pass,
// after one run that compiles the shaders, and with --hash the grid's content hash. Exits with 1
// when a pipeline fails, after the others have run.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/options/options.h"
#include "server/base/clock.h"
#include "server/base/simd/cpu_isa.h"
#include "server/gpu/context.h"
#include "server/gpu/shader_library.h"
#include "server/grid/content_hash.h"
#include "server/voxel/cpu/cpu_pipeline.h"
#include "server/voxel/gl/gl_pipeline.h"
#include "server/voxel/voxelize.h"
#include "tests/bench/bench_scene.h"
#include "tests/bench/process_memory.h"

namespace voxeld::bench {
namespace {

struct Arguments {
  std::string mesh, device = "llvmpipe", shader_dir, json, isa, shuffle;
  OptionPairs options;
  bool hash = false;
  int repeat = 5, threads = 0;
  std::vector<int> sizes;
  std::vector<std::string> pipelines = {"cpu", "compute", "raster"};
};

struct Measured {
  double median_ms = 0, min_ms = 0, peak_mb = 0;
  uint64_t voxels = 0, bricks = 0;
  int64_t cells = 0;  // of the grid, occupied or not
  std::string hash;
  StageTimes passes;  // medians
  VoxelizeStats stats;
};

// The objects that run one pipeline. The context outlives the programs made in it.
struct Engine {
  std::unique_ptr<gpu::Context> context;
  std::unique_ptr<gpu::ShaderLibrary> shaders;
  std::unique_ptr<Voxelizer> voxelizer;
  PipelineChoice choice = PipelineChoice::kCpu;
  std::string device = "cpu", isa;
};

bool has_option(const Arguments& arguments, std::string_view name) {
  return std::ranges::any_of(arguments.options, [&](const auto& o) { return o.first == name; });
}

Result<Arguments> parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string text = argv[i];
    const auto value = [&] { return std::string(i + 1 < argc ? argv[++i] : ""); };
    if (text == "--device") {
      arguments.device = value();
    } else if (text == "--shader-dir") {
      arguments.shader_dir = value();
    } else if (text == "--json") {
      arguments.json = value();
    } else if (text == "--isa") {
      arguments.isa = value();
    } else if (text == "--threads") {
      arguments.threads = std::max(0, std::atoi(value().c_str()));
    } else if (text == "--shuffle") {
      arguments.shuffle = value();
    } else if (text == "--hash") {
      arguments.hash = true;
    } else if (text == "--repeat") {
      arguments.repeat = std::max(1, std::atoi(value().c_str()));
    } else if (text == "--normal") {
      arguments.options.emplace_back("channels", "occupancy,normal");
    } else if (text == "--pipeline") {
      arguments.pipelines = {value()};
    } else if (text.starts_with("--")) {
      arguments.options.emplace_back(text.substr(2), value());
    } else if (arguments.mesh.empty()) {
      arguments.mesh = text;
    } else {
      arguments.sizes.push_back(std::atoi(text.c_str()));
    }
  }
  if (arguments.mesh.empty() || arguments.sizes.empty()) {
    return Error{ErrorCode::kInvalidOption, "voxelize_bench MESH [options] SIZE...",
                 "MESH: " + std::string(kSceneHelp), "neither or one of them"};
  }
  // Without a word of colour, occupancy alone is timed.
  if (!has_option(arguments, "channels") && !has_option(arguments, "color")) {
    arguments.options.emplace_back("color", "none");
  }
  return arguments;
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

Result<CpuIsa> parse_isa(const std::string& name) {
  std::string names;
  for (const CpuIsa isa : supported_cpu_isas()) {
    if (cpu_isa_name(isa) == name) return isa;
    names.append(names.empty() ? "" : ", ").append(cpu_isa_name(isa));
  }
  return Error{ErrorCode::kDeviceUnavailable, "instruction set", names, name};
}

Result<Engine> cpu_engine(const Arguments& arguments) {
  Engine engine;
  if (arguments.isa.empty()) {
    engine.isa = cpu_isa_name(best_cpu_isa());
    engine.voxelizer = std::make_unique<Voxelizer>(nullptr, arguments.threads);
    return engine;
  }
  // The voxelizer's own takes the widest instruction set; another one stands in for a device.
  VOXELD_ASSIGN(const CpuIsa isa, parse_isa(arguments.isa));
  engine.isa = cpu_isa_name(isa);
  engine.voxelizer =
      std::make_unique<Voxelizer>(std::make_unique<CpuPipeline>(arguments.threads, isa));
  engine.choice = PipelineChoice::kCompute;
  return engine;
}

Result<Engine> make_engine(const Arguments& arguments, const std::string& pipeline) {
  if (pipeline == "cpu") return cpu_engine(arguments);
  if (pipeline != "compute" && pipeline != "raster") {
    return Error{ErrorCode::kInvalidOption, "pipeline", "cpu, compute or raster", pipeline};
  }
  VOXELD_ASSIGN(const gpu::DeviceId device, gpu::parse_device(arguments.device));
  Engine engine;
  VOXELD_ASSIGN(engine.context, gpu::Context::create(device));
  engine.device = engine.context->info().renderer;
  engine.shaders = std::make_unique<gpu::ShaderLibrary>(*engine.context, arguments.shader_dir);
  engine.voxelizer =
      std::make_unique<Voxelizer>(std::make_unique<GlPipeline>(*engine.context, *engine.shaders));
  engine.choice = pipeline == "raster" ? PipelineChoice::kRaster : PipelineChoice::kCompute;
  return engine;
}

uint64_t brick_count(const Grid& grid) {
  uint64_t bricks = 0;
  for (const SparseTile& tile : grid.tiles) bricks += tile.masks.size() + tile.full.size();
  return bricks;
}

Result<Measured> measure(const Arguments& arguments, const Scene& scene, Engine& engine, int size) {
  VOXELD_ASSIGN(const RequestOptions request,
                parse_options(arguments.options, OptionScope::kVoxelize));
  VoxelizeOptions options = request.voxelize;
  options.pipeline = engine.choice;
  options.placement.size = size;
  std::vector<double> totals;
  std::map<std::string, std::vector<double>> passes;
  std::vector<std::string> order;
  Measured measured;
  reset_peak_memory();
  for (int i = 0; i <= arguments.repeat; ++i) {
    measured.stats = {};
    const Stopwatch watch;
    VOXELD_ASSIGN(const Grid grid, engine.voxelizer->voxelize(scene, options, {}, &measured.stats));
    if (i == 0) continue;
    totals.push_back(watch.ms());
    measured.voxels = grid.voxel_count();
    measured.bricks = brick_count(grid);
    measured.cells = grid.spec.cell_count();
    for (const auto& [pass, ms] : measured.stats.passes) {
      if (passes[pass].empty()) order.push_back(pass);
      passes[pass].push_back(ms);
    }
    if (i == arguments.repeat) measured.peak_mb = peak_memory_mb();
    if (i == arguments.repeat && arguments.hash) measured.hash = content_hash(grid);
  }
  measured.median_ms = median(totals);
  measured.min_ms = *std::ranges::min_element(totals);
  for (const std::string& pass : order) measured.passes.emplace_back(pass, median(passes[pass]));
  return measured;
}

void print(const std::string& pipeline, int size, const Measured& measured) {
  std::printf("%-8s %5d  %9.2f ms  %10llu voxels %7lld items %4lld tiles %6.1f MB |",
              pipeline.c_str(), size, measured.median_ms,
              static_cast<unsigned long long>(measured.voxels),
              static_cast<long long>(measured.stats.work_items),
              static_cast<long long>(measured.stats.tiles),
              static_cast<double>(measured.stats.device_bytes_peak) / 1e6);
  for (const auto& [pass, ms] : measured.passes) std::printf(" %s %.2f", pass.c_str(), ms);
  std::printf("%s%s\n", measured.hash.empty() ? "" : " ", measured.hash.c_str());
  std::fflush(stdout);
}

nlohmann::json row(const Arguments& arguments, const Scene& scene, const Engine& engine,
                   const std::string& pipeline, int size, const Measured& measured) {
  nlohmann::json passes = nlohmann::json::object();
  for (const auto& [pass, ms] : measured.passes) passes[pass] = ms;
  return {{"mesh", arguments.mesh},
          {"triangles", scene.triangle_count()},
          {"vertices", scene.vertex_count()},
          {"device", engine.device},
          {"pipeline", pipeline},
          {"isa", engine.isa},
          {"threads", arguments.threads},
          {"size", size},
          {"runs", arguments.repeat},
          {"ms", measured.median_ms},
          {"min_ms", measured.min_ms},
          {"voxels", measured.voxels},
          {"bricks", measured.bricks},
          {"cells", measured.cells},
          {"tiles", measured.stats.tiles},
          {"work_items", measured.stats.work_items},
          {"device_mb", static_cast<double>(measured.stats.device_bytes_peak) / 1e6},
          {"peak_mb", measured.peak_mb},
          {"hash", measured.hash},
          {"passes", passes}};
}

Status run_pipeline(const Arguments& arguments, const Scene& scene, const std::string& pipeline,
                    nlohmann::json& rows) {
  VOXELD_ASSIGN(Engine engine, make_engine(arguments, pipeline));
  if (engine.context) std::printf("%s on %s\n", pipeline.c_str(), engine.device.c_str());
  for (const int size : arguments.sizes) {
    VOXELD_ASSIGN(const Measured measured, measure(arguments, scene, engine, size));
    print(pipeline, size, measured);
    rows.push_back(row(arguments, scene, engine, pipeline, size, measured));
    // After each, so that what was measured outlives a driver's crash.
    if (!arguments.json.empty()) std::ofstream(arguments.json) << rows.dump(2) << "\n";
  }
  return {};
}

bool report(const Status& status) {
  if (!status) std::fprintf(stderr, "%s\n", status.error().message().c_str());
  return status.ok();
}

bool run_all(const Arguments& arguments) {
  auto scene = bench_scene(arguments.mesh);
  if (!scene) return report(scene.error());
  if (!arguments.shuffle.empty()) {
    shuffle_triangles(*scene, static_cast<uint32_t>(std::atoi(arguments.shuffle.c_str())));
  }
  std::printf("%s: %zu triangles\n", arguments.mesh.c_str(), scene->triangle_count());
  nlohmann::json rows = nlohmann::json::array();
  bool all_well = true;
  for (const std::string& pipeline : arguments.pipelines) {
    all_well = report(run_pipeline(arguments, *scene, pipeline, rows)) && all_well;
  }
  return all_well;
}

}  // namespace
}  // namespace voxeld::bench

int main(int argc, char** argv) {
  const auto arguments = voxeld::bench::parse(argc, argv);
  if (!arguments) return voxeld::bench::report(arguments.error()) ? 0 : 2;
  return voxeld::bench::run_all(*arguments) ? 0 : 1;
}
