// voxeld's pipeline cpu beside other voxelizers, on the same mesh in the same run:
//   rivals_bench MESH|wave:TRIANGLES [--runs N] [--json FILE] SIZE...
// Each pair of voxelizer and size runs in a process of its own, after one run that warms up. Prints
// a table of median milliseconds from the mesh in memory to its voxels, how many times as long as
// voxeld that is, and the process's peak memory. The mesh itself is in every process's memory.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "server/base/file.h"
#include "server/base/stopwatch.h"
#include "server/scene/load.h"
#include "server/voxel/voxelize.h"
#include "tests/bench/rival.h"

namespace voxeld::bench {
namespace {

struct Arguments {
  std::string mesh, json;
  int runs = 7;
  std::vector<int> sizes;
};

struct Measured {
  double median_ms = 0;
  uint64_t voxels = 0;
  double peak_mb = 0;
};

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string text = argv[i];
    const auto value = [&] { return std::string(i + 1 < argc ? argv[++i] : ""); };
    if (text == "--runs") {
      arguments.runs = std::max(1, std::atoi(value().c_str()));
    } else if (text == "--json") {
      arguments.json = value();
    } else if (arguments.mesh.empty()) {
      arguments.mesh = text;
    } else {
      arguments.sizes.push_back(std::atoi(text.c_str()));
    }
  }
  return arguments;
}

// A sphere with waves on it, of about as many triangles, all of about one size near the equator.
Scene wave_scene(int triangles) {
  const int rows = std::max(2, static_cast<int>(std::sqrt(triangles / 4.0)));
  const int columns = 2 * rows;
  Scene scene;
  MeshPart& part = scene.parts.emplace_back();
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double theta = std::numbers::pi * row / rows;
      const double phi = 2.0 * std::numbers::pi * column / columns;
      const double r = 1.0 + 0.1 * std::sin(9.0 * theta) * std::sin(7.0 * phi);
      part.positions.emplace_back(r * std::sin(theta) * std::cos(phi), r * std::cos(theta),
                                  r * std::sin(theta) * std::sin(phi));
    }
  }
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const auto at = [&](int r, int c) {
        return static_cast<uint32_t>(r * columns + c % columns);
      };
      const uint32_t a = at(row, column), b = at(row, column + 1), c = at(row + 1, column);
      const uint32_t d = at(row + 1, column + 1);
      for (const uint32_t index : {a, b, c, b, d, c}) part.indices.push_back(index);
    }
  }
  return scene;
}

Result<Scene> scene_of(const std::string& mesh) {
  if (mesh.starts_with("wave:")) return wave_scene(std::atoi(mesh.c_str() + 5));
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(mesh));
  return load_scene(mesh, file.bytes());
}

GridMesh grid_mesh(const Scene& scene, int size) {
  const Box3d box = world_bounds(scene, glm::dmat4(1.0));
  const glm::dvec3 extent = box.max - box.min;
  const double scale = size / std::max({extent.x, extent.y, extent.z});
  GridMesh mesh;
  mesh.size = size;
  for (const MeshPart& part : scene.parts) {
    const auto first = static_cast<int>(mesh.positions.size() / 3);
    for (const glm::vec3& p : part.positions) {
      const glm::dvec3 q = (glm::dvec3(p) - box.min) * scale;
      for (int c = 0; c < 3; ++c) mesh.positions.push_back(static_cast<float>(q[c]));
    }
    for (const uint32_t i : part.indices) mesh.indices.push_back(first + static_cast<int>(i));
  }
  return mesh;
}

// In a process of its own. `make` gives what is run and timed.
template <typename Make>
Measured measure(int runs, const Make& make) {
  int ends[2];
  if (::pipe(ends) != 0) std::abort();
  const pid_t child = ::fork();
  if (child == 0) {
    const auto run = make();
    Measured measured;
    std::vector<double> times;
    for (int i = 0; i <= runs; ++i) {
      const Stopwatch watch;
      measured.voxels = run();
      if (i > 0) times.push_back(watch.ms());
    }
    std::sort(times.begin(), times.end());
    measured.median_ms = times[times.size() / 2];
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    measured.peak_mb = static_cast<double>(usage.ru_maxrss) / 1024.0;
    const bool written = ::write(ends[1], &measured, sizeof measured) == sizeof measured;
    ::_exit(written ? 0 : 1);
  }
  ::close(ends[1]);
  Measured measured;
  const bool is_read = ::read(ends[0], &measured, sizeof measured) == sizeof measured;
  ::close(ends[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  if (!is_read || status != 0) std::fprintf(stderr, "a voxelizer failed\n");
  return measured;
}

Measured measure_voxeld(const Scene& scene, int size, int runs) {
  return measure(runs, [&] {
    return [&scene, size, voxelizer = std::make_shared<Voxelizer>()] {
      VoxelizeOptions options;
      options.placement.size = size;
      options.color = ColorMode::kNone;
      const auto grid = voxelizer->voxelize(scene, options, {}, nullptr);
      uint64_t voxels = 0;
      for (const SparseTile& tile : grid.value().tiles) voxels += tile.voxel_count();
      return voxels;
    };
  });
}

std::vector<Rival> rivals() {
  std::vector<Rival> all;
#if VOXELD_BENCH_RECAST
  all.push_back(recast_rival());
#endif
#if VOXELD_BENCH_OPENVDB
  all.push_back(openvdb_rival());
#endif
  return all;
}

Status run_all(const Arguments& arguments) {
  VOXELD_ASSIGN(const Scene scene, scene_of(arguments.mesh));
  std::printf("%s: %zu triangles, %ld cores, median of %d\n\n", arguments.mesh.c_str(),
              scene.triangle_count(), ::sysconf(_SC_NPROCESSORS_ONLN), arguments.runs);
  std::printf(
      "| size | voxelizer | ms | times voxeld | peak MB | voxels |\n|---|---|---|---|---|---|\n");
  nlohmann::json rows = nlohmann::json::array();
  for (const int size : arguments.sizes) {
    const Measured own = measure_voxeld(scene, size, arguments.runs);
    const auto row = [&](const std::string& name, const Measured& measured) {
      std::printf("| %d | %s | %.1f | %.2f | %.0f | %llu |\n", size, name.c_str(),
                  measured.median_ms, measured.median_ms / own.median_ms, measured.peak_mb,
                  static_cast<unsigned long long>(measured.voxels));
      std::fflush(stdout);
      rows.push_back({{"mesh", arguments.mesh},
                      {"size", size},
                      {"voxelizer", name},
                      {"ms", measured.median_ms},
                      {"ratio", measured.median_ms / own.median_ms},
                      {"peak_mb", measured.peak_mb},
                      {"voxels", measured.voxels}});
    };
    row("voxeld cpu", own);
    for (const Rival& rival : rivals()) {
      row(rival.name, measure(arguments.runs, [&] {
            return [&rival, mesh = grid_mesh(scene, size)] { return rival.run(mesh); };
          }));
    }
  }
  if (!arguments.json.empty()) std::ofstream(arguments.json) << rows.dump(2) << "\n";
  return {};
}

}  // namespace
}  // namespace voxeld::bench

int main(int argc, char** argv) {
  const auto arguments = voxeld::bench::parse(argc, argv);
  const auto status = voxeld::bench::run_all(arguments);
  if (!status) std::fprintf(stderr, "%s\n", status.error().message().c_str());
  return status ? 0 : 1;
}
