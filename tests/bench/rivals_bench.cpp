// voxeld's pipeline cpu beside other voxelizers, on the same mesh in the same run:
//   rivals_bench MESH [--solid | --band] [--NAME VALUE]... [--runs N] [--json FILE] SIZE...
// MESH as in bench_scene.h; --NAME VALUE are options of voxeld's request, --solid is also --fill
// solid, --band --fill band of three voxels to each side. Each pair of voxelizer and size runs in a
// process of its own, after one run that warms up. Prints a table of median milliseconds from the
// mesh in memory to its voxels, how many times as long as voxeld that is, and the process's peak
// memory. The mesh itself is in every process's memory.
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "server/base/clock.h"
#include "server/voxel/voxelize.h"
#include "tests/bench/bench_scene.h"
#include "tests/bench/process_memory.h"
#include "tests/bench/rival.h"

namespace voxeld::bench {
namespace {

struct Arguments {
  std::string mesh, json;
  OptionPairs options = {{"color", "none"}};
  Rival::Count Rival::*kind = &Rival::surface;
  int runs = 7;
  std::vector<int> sizes;
};

// Crosses a pipe as it is.
struct Measured {
  double median_ms = 0;
  uint64_t voxels = 0;
  double peak_mb = 0;
  char error[256] = "the process ended early";
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
    } else if (text == "--solid") {
      arguments.kind = &Rival::solid;
      arguments.options.emplace_back("fill", "solid");
    } else if (text == "--band") {
      arguments.kind = &Rival::band;
      arguments.options.emplace_back("fill", "band");
    } else if (text.starts_with("--")) {
      arguments.options.emplace_back(text.substr(2), value());
    } else if (arguments.mesh.empty()) {
      arguments.mesh = text;
    } else {
      arguments.sizes.push_back(std::atoi(text.c_str()));
    }
  }
  return arguments;
}

template <typename Make>
Measured measure_here(int runs, const Make& make) try {
  const auto run = make();
  Measured measured;
  std::vector<double> times;
  for (int i = 0; i <= runs; ++i) {
    const Stopwatch watch;
    measured.voxels = run();
    if (i > 0) times.push_back(watch.ms());
  }
  std::ranges::sort(times);
  measured.median_ms = times[times.size() / 2];
  measured.peak_mb = peak_memory_mb();
  measured.error[0] = 0;
  return measured;
} catch (const std::exception& e) {
  Measured measured;
  std::snprintf(measured.error, sizeof measured.error, "%s", e.what());
  return measured;
}

// In a process of its own. `make` gives what is run and timed.
template <typename Make>
Measured measure(int runs, const Make& make) {
  int ends[2];
  if (::pipe(ends) != 0) std::abort();
  const pid_t child = ::fork();
  if (child == 0) {
    reset_peak_memory();
    const Measured measured = measure_here(runs, make);
    const bool written = ::write(ends[1], &measured, sizeof measured) == sizeof measured;
    ::_exit(written ? 0 : 1);
  }
  ::close(ends[1]);
  Measured measured;
  if (::read(ends[0], &measured, sizeof measured) != sizeof measured) measured = {};
  ::close(ends[0]);
  ::waitpid(child, nullptr, 0);
  return measured;
}

uint64_t voxels_of(Voxelizer& voxelizer, const Scene& scene, const Arguments& arguments, int size) {
  const auto request = parse_options(arguments.options, OptionScope::kVoxelize);
  if (!request) throw std::runtime_error(request.error().message());
  VoxelizeOptions options = request->voxelize;
  options.placement.size = size;
  const auto grid = voxelizer.voxelize(scene, options, {}, nullptr);
  if (!grid) throw std::runtime_error(grid.error().message());
  return grid->voxel_count();
}

Measured measure_voxeld(const Scene& scene, const Arguments& arguments, int size) {
  return measure(arguments.runs, [&] {
    return [&, size, voxelizer = std::make_shared<Voxelizer>()] {
      return voxels_of(*voxelizer, scene, arguments, size);
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
#if VOXELD_BENCH_VTK
  all.push_back(vtk_rival());
#endif
  return all;
}

// Prints the row and gives it as JSON. `own_ms`: voxeld's time, 0 where it has none.
nlohmann::json row(const std::string& mesh, int size, const std::string& name,
                   const Measured& measured, double own_ms) {
  nlohmann::json cells = {{"mesh", mesh}, {"size", size}, {"voxelizer", name}};
  if (measured.error[0] != 0) {
    std::printf("| %d | %s | %s | | | |\n", size, name.c_str(), measured.error);
    cells["skipped"] = measured.error;
  } else {
    const double ratio = own_ms > 0 ? measured.median_ms / own_ms : 0;
    std::printf("| %d | %s | %.1f | %.2f | %.0f | %llu |\n", size, name.c_str(), measured.median_ms,
                ratio, measured.peak_mb, static_cast<unsigned long long>(measured.voxels));
    cells.update({{"ms", measured.median_ms},
                  {"ratio", ratio},
                  {"peak_mb", measured.peak_mb},
                  {"voxels", measured.voxels}});
  }
  std::fflush(stdout);
  return cells;
}

Status run_all(const Arguments& arguments) {
  VOXELD_ASSIGN(const Scene scene, bench_scene(arguments.mesh));
  std::printf("%s: %zu triangles, %ld cores, median of %d\n\n", arguments.mesh.c_str(),
              scene.triangle_count(), ::sysconf(_SC_NPROCESSORS_ONLN), arguments.runs);
  std::printf(
      "| size | voxelizer | ms | times voxeld | peak MB | voxels |\n|---|---|---|---|---|---|\n");
  nlohmann::json rows = nlohmann::json::array();
  for (const int size : arguments.sizes) {
    const Measured own = measure_voxeld(scene, arguments, size);
    rows.push_back(row(arguments.mesh, size, "voxeld cpu", own, own.median_ms));
    for (const Rival& rival : rivals()) {
      const Rival::Count& count = rival.*arguments.kind;
      if (!count) continue;
      const Measured measured = measure(arguments.runs, [&] {
        return [&count, mesh = grid_mesh(scene, size)] { return count(mesh); };
      });
      rows.push_back(row(arguments.mesh, size, rival.name, measured, own.median_ms));
    }
    if (!arguments.json.empty()) std::ofstream(arguments.json) << rows.dump(2) << "\n";
  }
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
