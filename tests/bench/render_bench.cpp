// Times images of one mesh: render_bench MESH [--device D] [--image N] [--repeat N] [--out DIR]
// [--color] [--samples N] [--shader-dir DIR] [--set NAME=VALUE]... SIZE... prints one line per
// size: packing and uploading the grid, one image, its PNG; medians of the runs in milliseconds,
// after one that compiles the shaders. --set gives options of a render request; --out keeps the
// images; device cpu needs no context.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "server/base/clock.h"
#include "server/base/disk/file.h"
#include "server/gpu/context.h"
#include "server/gpu/shader_library.h"
#include "server/render/cpu/cpu_renderer.h"
#include "server/render/gl_renderer.h"
#include "server/scene/load.h"
#include "server/voxel/voxelize.h"

namespace voxeld {
namespace {

struct Arguments {
  std::string mesh, device = "llvmpipe", out, shader_dir;
  OptionPairs options;
  bool color = false;
  int repeat = 5, image = 512;
  RenderQuality quality;
  std::vector<int> sizes;
};

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string text = argv[i];
    const auto value = [&] { return std::string(i + 1 < argc ? argv[++i] : ""); };
    if (text == "--device") {
      arguments.device = value();
    } else if (text == "--image") {
      arguments.image = std::max(1, std::atoi(value().c_str()));
    } else if (text == "--samples") {
      arguments.quality.samples_per_side = std::clamp(std::atoi(value().c_str()), 1, 4);
    } else if (text == "--shader-dir") {
      arguments.shader_dir = value();
    } else if (text == "--repeat") {
      arguments.repeat = std::max(1, std::atoi(value().c_str()));
    } else if (text == "--out") {
      arguments.out = value();
    } else if (text == "--color") {
      arguments.color = true;
    } else if (text == "--set") {
      const std::string pair = value();
      const size_t equals = std::min(pair.find('='), pair.size());
      arguments.options.emplace_back(pair.substr(0, equals),
                                     pair.substr(std::min(equals + 1, pair.size())));
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

Status run(const Arguments& arguments, const RenderOptions& options, const Grid& grid,
           Renderer& renderer, int size) {
  std::vector<double> set_ms, image_ms, cpu_ms, png_ms;
  std::vector<uint8_t> png;
  for (int i = 0; i <= arguments.repeat; ++i) {
    Stopwatch set;
    VOXELD_TRY(renderer.set_grid(grid));
    set_ms.push_back(set.ms());
    Stopwatch draw;
    const std::clock_t cpu_start = std::clock();
    VOXELD_ASSIGN(const RenderImage image, renderer.render(options, {}));
    image_ms.push_back(draw.ms());
    cpu_ms.push_back(1e3 * static_cast<double>(std::clock() - cpu_start) / CLOCKS_PER_SEC);
    Stopwatch encode;
    VOXELD_ASSIGN(png, encode_png(image));
    png_ms.push_back(encode.ms());
    if (i > 0) continue;
    set_ms.clear();
    image_ms.clear();
    cpu_ms.clear();
    png_ms.clear();
  }
  std::printf(
      "%5d  %9llu voxels  set_grid %8.2f ms  image %dx%d %8.2f ms (cpu %8.2f)  png %6.2f ms\n",
      size, static_cast<unsigned long long>(grid.voxel_count()), median(set_ms), options.width,
      options.height, median(image_ms), median(cpu_ms), median(png_ms));
  std::fflush(stdout);
  if (arguments.out.empty()) return {};
  const std::filesystem::path path =
      std::filesystem::path(arguments.out) /
      (std::filesystem::path(arguments.mesh).stem().string() + "-" + std::to_string(size) + ".png");
  return write_file(path, png);
}

// In the order of what needs what.
struct Device {
  std::unique_ptr<gpu::Context> context;  // none on the CPU
  std::unique_ptr<gpu::ShaderLibrary> shaders;
  std::unique_ptr<Renderer> renderer;

  std::string name() const { return context ? context->info().renderer : "the CPU"; }
};

Status open_device(const Arguments& arguments, Device& device) {
  if (arguments.device == "cpu") {
    device.renderer = std::make_unique<CpuRenderer>();
    return {};
  }
  VOXELD_ASSIGN(const gpu::DeviceId id, gpu::parse_device(arguments.device));
  VOXELD_ASSIGN(device.context, gpu::Context::create(id));
  device.shaders = std::make_unique<gpu::ShaderLibrary>(*device.context, arguments.shader_dir);
  device.renderer = std::make_unique<GlRenderer>(*device.context, *device.shaders);
  return {};
}

Status run_all(const Arguments& arguments) {
  VOXELD_ASSIGN(RequestOptions request, parse_options(arguments.options, OptionScope::kRenderGrid));
  request.render.width = request.render.height = arguments.image;
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(arguments.mesh));
  VOXELD_ASSIGN(const Scene scene, load_scene(arguments.mesh, file.bytes()));
  Device device;
  VOXELD_TRY(open_device(arguments, device));
  std::printf("%s on %s: %zu triangles\n", arguments.mesh.c_str(), device.name().c_str(),
              scene.triangle_count());
  Voxelizer voxelizer;
  device.renderer->set_quality(arguments.quality);
  for (const int size : arguments.sizes) {
    VoxelizeOptions options;
    options.pipeline = PipelineChoice::kCpu;
    options.color = arguments.color ? ColorMode::kAverage : ColorMode::kNone;
    options.placement.size = size;
    VOXELD_ASSIGN(const Grid grid, voxelizer.voxelize(scene, options, {}, nullptr));
    VOXELD_TRY(run(arguments, request.render, grid, *device.renderer, size));
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
