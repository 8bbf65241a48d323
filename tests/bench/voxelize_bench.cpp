// Times the pipelines on one mesh: voxelize_bench MESH [--device D] [--rule R] [--color MODE]
// [--normal] [--repeat N] [--pipeline P] [--fill F] [--sign S] [--thickness T] [--shader-dir DIR]
// SIZE... prints one line per pipeline and size: median of the runs in milliseconds, whole and by
// pass, after one run that compiles the shaders. MESH "waves" is a closed mesh of 81,920 triangles
// that is made for the purpose, "waves-N" one of 20 * 4^N.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "server/base/file.h"
#include "server/base/stopwatch.h"
#include "server/gpu/context.h"
#include "server/gpu/shader_library.h"
#include "server/scene/load.h"
#include "server/voxel/gl/gl_pipeline.h"
#include "server/voxel/voxelize.h"
#include "tests/bench/waves.h"

namespace voxeld {
namespace {

struct Arguments {
  std::string mesh, device = "llvmpipe", shader_dir;
  VoxelizeOptions options;
  int repeat = 5;
  std::vector<int> sizes;
  std::vector<PipelineChoice> pipelines = {PipelineChoice::kCpu, PipelineChoice::kCompute,
                                           PipelineChoice::kRaster};
};

Sign sign_of(const std::string& name) {
  return name == "parity"     ? Sign::kParity
         : name == "nonzero"  ? Sign::kNonzero
         : name == "majority" ? Sign::kMajority
         : name == "flood"    ? Sign::kFlood
         : name == "winding"  ? Sign::kWinding
                              : Sign::kAuto;
}

Result<Scene> load_mesh(const std::string& name) {
  if (name == "waves") return wavy_sphere(6);
  if (name.starts_with("waves-")) return wavy_sphere(std::clamp(std::atoi(&name[6]), 0, 10));
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(name));
  return load_scene(name, file.bytes());
}

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  arguments.options.color = ColorMode::kNone;
  for (int i = 1; i < argc; ++i) {
    const std::string text = argv[i];
    const auto value = [&] { return std::string(i + 1 < argc ? argv[++i] : ""); };
    if (text == "--device") {
      arguments.device = value();
    } else if (text == "--shader-dir") {
      arguments.shader_dir = value();
    } else if (text == "--repeat") {
      arguments.repeat = std::max(1, std::atoi(value().c_str()));
    } else if (text == "--normal") {
      arguments.options.channels_given = arguments.options.channel_normal = true;
    } else if (text == "--color") {
      const std::string mode = value();
      arguments.options.color = mode == "average"  ? ColorMode::kAverage
                                : mode == "shaded" ? ColorMode::kShaded
                                : mode == "axis"   ? ColorMode::kAxis
                                                   : ColorMode::kNone;
    } else if (text == "--rule") {
      const std::string name = value();
      arguments.options.rule = name == "thin"     ? Rule::kThin
                               : name == "center" ? Rule::kCenter
                               : name == "none"   ? Rule::kNone
                                                  : Rule::kTouch;
    } else if (text == "--fill") {
      const std::string name = value();
      arguments.options.fill = name == "solid"   ? Fill::kSolid
                               : name == "shell" ? Fill::kShell
                                                 : Fill::kSurface;
    } else if (text == "--sign") {
      arguments.options.sign = sign_of(value());
    } else if (text == "--thickness") {
      arguments.options.thickness = std::atof(value().c_str());
    } else if (text == "--pipeline") {
      const std::string name = value();
      arguments.pipelines = {name == "raster"    ? PipelineChoice::kRaster
                             : name == "compute" ? PipelineChoice::kCompute
                                                 : PipelineChoice::kCpu};
    } else if (arguments.mesh.empty()) {
      arguments.mesh = text;
    } else {
      arguments.sizes.push_back(std::atoi(text.c_str()));
    }
  }
  return arguments;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

Status run(const Arguments& arguments, const Scene& scene, Voxelizer& voxelizer,
           PipelineChoice pipeline, int size) {
  VoxelizeOptions options = arguments.options;
  options.pipeline = pipeline;
  options.placement.size = size;
  std::vector<double> totals;
  std::map<std::string, std::vector<double>> passes;
  std::vector<std::string> order;
  VoxelizeStats stats;
  uint64_t voxels = 0;
  for (int i = 0; i <= arguments.repeat; ++i) {
    stats = {};
    const Stopwatch watch;
    VOXELD_ASSIGN(const Grid grid, voxelizer.voxelize(scene, options, {}, &stats));
    if (i == 0) continue;
    totals.push_back(watch.ms());
    voxels = 0;
    for (const SparseTile& tile : grid.tiles) voxels += tile.voxel_count();
    for (const auto& [pass, ms] : stats.passes) {
      if (passes[pass].empty()) order.push_back(pass);
      passes[pass].push_back(ms);
    }
  }
  std::printf("%-8s %5d  %9.2f ms  %10llu voxels %7lld items %4lld tiles %6.1f MB |",
              std::string(pipeline_name(stats.pipeline)).c_str(), size, median(totals),
              static_cast<unsigned long long>(voxels), static_cast<long long>(stats.work_items),
              static_cast<long long>(stats.tiles),
              static_cast<double>(stats.device_bytes_peak) / 1e6);
  for (const std::string& pass : order) {
    std::printf(" %s %.2f", pass.c_str(), median(passes[pass]));
  }
  std::printf("\n");
  std::fflush(stdout);
  return {};
}

Status run_all(const Arguments& arguments) {
  VOXELD_ASSIGN(const gpu::DeviceId device, gpu::parse_device(arguments.device));
  VOXELD_ASSIGN(const auto context, gpu::Context::create(device));
  VOXELD_ASSIGN(const Scene scene, load_mesh(arguments.mesh));
  std::printf("%s on %s: %zu triangles\n", arguments.mesh.c_str(), context->info().renderer.c_str(),
              scene.triangle_count());
  gpu::ShaderLibrary shaders(*context, arguments.shader_dir);
  Voxelizer voxelizer(std::make_unique<GlPipeline>(*context, shaders));
  for (const PipelineChoice pipeline : arguments.pipelines) {
    for (const int size : arguments.sizes) {
      VOXELD_TRY(run(arguments, scene, voxelizer, pipeline, size));
    }
  }
  return {};
}

}  // namespace
}  // namespace voxeld

int main(int argc, char** argv) {
  const auto status = voxeld::run_all(voxeld::parse(argc, argv));
  if (!status) std::fprintf(stderr, "%s\n", status.error().message().c_str());
  return status ? 0 : 1;
}
