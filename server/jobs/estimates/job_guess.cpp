#include "server/jobs/estimates/job_guess.h"

#include <algorithm>
#include <cmath>

namespace voxeld {
namespace {

// Rays along each side of a pixel where the renderer chooses.
constexpr int kUsualSamples = 2;
constexpr double kNs = 1e-9;

// For each cell of a side's square, and for each cell of the whole grid.
struct GridCost {
  double area = 0, volume = 0;
};

// Nanoseconds of writing a format, and bytes of its file before the attributes of the voxels.
struct FormatCost {
  GridCost time, bytes;
};

FormatCost format_cost(const OutputOptions& output) {
  const bool is_smooth = output.mesh == MeshSurface::kSmooth;
  const bool is_sparse = output.layout == ArrayLayout::kSparse;
  const GridCost array_time = is_sparse ? GridCost{200, 0} : GridCost{100, 1};
  switch (output.format) {
    case Format::kNative:
      return {{20, 0}, {0.7, 0}};
    case Format::kGlb:
    case Format::kPly:
    case Format::kObj:
      return {{is_smooth ? 8000.0 : 2000.0, 0}, {60, 0}};
    case Format::kXyz:
    case Format::kCsv:
    case Format::kPcd:
    case Format::kVtu:
    case Format::kInp:
    case Format::kLdr:
      return {{1500, 0}, {30, 0}};
    case Format::kVdb:
    case Format::kNvdb:
    case Format::kBt:
      return {{600, 0}, {4, 0}};
    case Format::kNpy:
    case Format::kNrrd:
    case Format::kMha:
      return {array_time, {0, 1}};
    default:
      return {array_time, {4, 0}};
  }
}

// Nanoseconds of finding the voxels.
GridCost voxelize_cost(const VoxelizeOptions& options) {
  GridCost cost{30, 0};
  const bool has_attributes = !options.channels || options.channels->color ||
                              options.channels->normal != 0 || options.channels->label;
  if (has_attributes) cost.area += 150;
  if (options.measures()) cost.volume += 14;
  if (options.fill == Fill::kBand) cost.area += 100 * options.thickness;
  if (!options.has_inside()) return cost;
  cost.volume += options.fill == Fill::kShell ? 16 : 8;
  // Closed meshes take a tenth of that, triangles without neighbours ten times.
  if (options.sign == Sign::kWinding) cost.volume += 80;
  return cost;
}

// Nanoseconds of changing them.
GridCost change_cost(const OutputOptions& output) {
  GridCost cost;
  cost.area += 600 * (output.dilate + output.erode);
  if (output.hollow > 0) cost.volume += 4;
  return cost;
}

// The side of a cube with as many cells as are written.
double written_side(const OutputOptions& output, double side) {
  if (output.region) {
    const auto& [x0, y0, z0, x1, y1, z1] = *output.region;
    const double cells = static_cast<double>(x1 - x0) * (y1 - y0) * (z1 - z0);
    side = std::min(side, std::cbrt(cells));
  }
  return std::max(1.0, std::ldexp(side, -output.level));
}

double total(const GridCost& cost, double side) {
  return cost.area * side * side + cost.volume * side * side * side;
}

// Nanoseconds for each byte: of reading it, and of the triangles in it.
struct InputCost {
  double read = 0, triangles = 0;
};
InputCost input_cost(JobInput::Form form) {
  switch (form) {
    case JobInput::Form::kGrid:
      return {2, 0};
    case JobInput::Form::kBinary:
      return {10, 32};
    case JobInput::Form::kGlb:
      return {10, 12};
    case JobInput::Form::kText:
    case JobInput::Form::kZip:
      return {12, 8};
  }
  return {};
}

}  // namespace

double longest_side(const PlacementOptions& placement) {
  if (placement.dims) return *std::ranges::max_element(*placement.dims);
  return placement.size.value_or(kDefaultSize);
}

double ray_side(const RenderOptions& render) {
  return std::sqrt(static_cast<double>(render.width) * render.height) *
         (render.samples > 0 ? render.samples : kUsualSamples);
}

JobGuess guess_costs(JobKind kind, const RequestOptions& options, const JobInput& input) {
  constexpr double kTaskSeconds = 0.005, kDeviceSeconds = 0.002;
  const auto bytes = static_cast<double>(input.bytes);
  const InputCost of_input = input_cost(input.form);
  JobGuess guess;
  guess.read_seconds = bytes * of_input.read * kNs;
  // The views of a turntable are of one grid, which is made once.
  const double views = kind == JobKind::kRender ? std::max(options.render.turntable, 1) : 1;
  guess.work_seconds = kTaskSeconds + bytes * of_input.triangles * kNs / views;
  guess.result_bytes = 1000;
  guess.host_bytes = 5e7 + 4 * bytes;
  double side = longest_side(options.voxelize.placement);
  if (input.form == JobInput::Form::kGrid) {
    // About a byte of a native container for each cell of a side's square.
    side = std::sqrt(bytes);
  } else if (kind != JobKind::kInspect) {
    constexpr double kMeasureSeconds = 0.08, kMeasureNs = 60;  // once, and for each byte
    guess.work_seconds += total(voxelize_cost(options.voxelize), side) * kNs / views;
    if (options.voxelize.measures())
      guess.work_seconds += (kMeasureSeconds + kMeasureNs * bytes * kNs) / views;
    guess.device_seconds = guess.work_seconds;
    guess.host_bytes += total({20, options.voxelize.has_inside() ? 0.5 : 0.0}, side);
  }
  guess.device_seconds += kDeviceSeconds;
  if (kind == JobKind::kVoxelize || kind == JobKind::kExport) {
    const FormatCost format = format_cost(options.output);
    const double written = written_side(options.output, side);
    guess.work_seconds +=
        (total(format.time, written) + total(change_cost(options.output), side)) * kNs;
    guess.result_bytes += total(format.bytes, written);
  } else if (kind == JobKind::kRender) {
    constexpr double kRayNs = 300, kBytesPerRay = 0.3;
    const double rays = ray_side(options.render) * ray_side(options.render);
    guess.work_seconds += kRayNs * rays * kNs;
    guess.device_seconds += kRayNs * rays * kNs;
    guess.result_bytes += kBytesPerRay * rays;
  }
  return guess;
}

}  // namespace voxeld
