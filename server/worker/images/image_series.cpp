#include "server/worker/images/image_series.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "proto/options/values.h"
#include "server/grid/region.h"
#include "server/render/animated_image.h"
#include "server/render/camera.h"
#include "server/render/raymarch_params.h"
#include "server/worker/frames/container_frames.h"
#include "server/worker/frames/frame_times.h"
#include "server/worker/grids/host_estimate.h"
#include "server/worker/images/image_grid.h"
#include "server/worker/task/serial_queue.h"

namespace voxeld {
namespace {

constexpr std::string_view kPngMediaType = "image/png";
// Bytes of images that wait to be encoded.
constexpr size_t kWaitingImageBytesMax = size_t{64} << 20;

std::vector<double> shown_durations(std::vector<double> durations_s,
                                    const std::optional<double>& rate) {
  if (rate) std::ranges::fill(durations_s, 1.0 / *rate);
  return durations_s;
}

Result<RenderImage> render_by(TaskRun& run, const Engine::ChosenRenderer& by,
                              const LoadedGrid& grid, const std::string& grid_key,
                              const RenderOptions& options) {
  if (*by.resident_key != grid_key) {
    by.resident_key->clear();
    VOXELD_TRY(by.renderer->set_grid(grid.grid));
    *by.resident_key = grid_key;
  }
  return by.renderer->render(options, progress_of(run));
}

// Draws the grid. Stage: render. Where GL fails and the request leaves the renderer to voxeld, the
// CPU draws.
Result<RenderImage> render_image(TaskRun& run, const LoadedGrid& grid, const std::string& grid_key,
                                 const RenderOptions& options) {
  const StageTimer stage(run, "render");
  VOXELD_ASSIGN(Engine::ChosenRenderer by, run.engine.choose_renderer(options.renderer));
  const bool is_on_device = by.name == "gl";
  VOXELD_TRY(run.slice.begin());
  const DeviceSlice::Scope slice(run.slice);
  Result<RenderImage> image = render_by(run, by, grid, grid_key, options);
  const bool has_device_failed = is_on_device && !image.ok() &&
                                 (image.error().code == ErrorCode::kInternal ||
                                  image.error().code == ErrorCode::kDeviceUnavailable);
  if (is_on_device && (image.ok() || has_device_failed)) {
    run.engine.note_device(has_device_failed ? image.error().message() : "");
  }
  if (has_device_failed && options.renderer == RendererChoice::kAuto) {
    by.resident_key->clear();
    add_meta(run, {{"device_failure", image.error().message()}});
    VOXELD_ASSIGN(by, run.engine.choose_renderer(RendererChoice::kCpu));
    image = render_by(run, by, grid, grid_key, options);
  }
  const int64_t before = run.meta.value("device_bytes_peak", int64_t{0});  // of the voxelizer
  add_meta(run, {{"drawn_by", by.name},
                 {"device_bytes_peak",
                  std::max(before, static_cast<int64_t>(by.renderer->device_bytes()))}});
  return image;
}

Status write_sheet(TaskRun& run, const ImageSeries& series, const RenderOptions& options) {
  const size_t count = series.durations_s.size();
  VOXELD_ASSIGN(const SheetLayout layout,
                sheet_layout(count, options.columns, options.width, options.height));
  RenderImage sheet = begin_sheet(layout, image_background(options).top);
  for (size_t i = 0; i < count; ++i) {
    VOXELD_ASSIGN(const RenderImage image, series.take(i));
    place_in_sheet(layout, i, image, sheet);
  }
  add_meta(run, {{"images", count}, {"columns", layout.columns}});
  return write_image(run, sheet);
}

// A GIF with more than 50 images a second, or an APNG with more than 1,000, plays slower.
Status warn_of_slow_play(TaskRun& run, ImageKind kind, const std::vector<double>& durations_s) {
  double asked_s = 0.0, shown_s = 0.0;
  for (const double duration_s : durations_s) asked_s += std::max(duration_s, 0.0);
  VOXELD_ASSIGN(const std::vector<ShownTime> times, shown_times(kind, durations_s));
  for (const ShownTime& time : times) shown_s += 1.0 * time.parts / time.parts_per_s;
  constexpr double kRoundedS = 0.02;
  if (shown_s <= 1.01 * asked_s + kRoundedS) return {};
  const auto text = [](double s) { return option_values::to_text(std::round(100.0 * s) / 100.0); };
  add_warnings(run,
               {{"slower-play", "image: " + text(shown_s) + " seconds instead of " + text(asked_s) +
                                    ", since its format shows no more images a second"}});
  return {};
}

Status write_animation(TaskRun& run, const ImageSeries& series, const RenderOptions& options) {
  const bool is_gif = options.image == ImageKind::kGif;
  VOXELD_TRY(warn_of_slow_play(run, options.image, series.durations_s));
  const std::filesystem::path path = next_output(run);
  VOXELD_ASSIGN(
      const std::unique_ptr<AnimationWriter> writer,
      is_gif ? write_gif(path, series.durations_s) : write_apng(path, series.durations_s));
  SerialQueue side(kWaitingImageBytesMax);
  for (size_t i = 0; i < series.durations_s.size(); ++i) {
    VOXELD_ASSIGN(RenderImage image, series.take(i));
    const auto shared = std::make_shared<const RenderImage>(std::move(image));
    VOXELD_TRY(side.push(shared->rgba.size(), [&writer, shared] { return writer->add(*shared); }));
  }
  const StageTimer stage(run, "encode");
  VOXELD_TRY(side.wait());
  VOXELD_TRY(writer->finish());
  add_meta(run, {{"width", options.width},
                 {"height", options.height},
                 {"images", series.durations_s.size()}});
  list_output(run, path, "result", is_gif ? "image/gif" : "image/apng", is_gif ? ".gif" : ".apng");
  return run.monitor.check();
}

}  // namespace

Result<DrawnInput> open_drawn(TaskRun& run, const std::filesystem::path& container,
                              const std::string& key) {
  const InputCache& cache = run.engine.cache;
  DrawnInput input;
  if (cache.grid_key == key) input.whole = cache.grid;
  if (input.whole != nullptr) {
    input.resident = std::make_unique<GridTiles>(input.whole->grid);
  } else {
    VOXELD_ASSIGN(input.container, GridInput::open(run, container));
  }
  return input;
}

Result<RenderImage> take_image(TaskRun& run, const DrawnInput& input, const std::string& key,
                               const RequestOptions& options) {
  expect_bytes(run, image_bytes(run.engine, input.tiles(), options.render));
  VOXELD_ASSIGN(const ImageGrid drawn, image_grid(run, input.tiles(), key, input.whole, options));
  return render_image(run, *drawn.grid, drawn.key, drawn.options);
}

std::vector<double> view_durations(const RenderOptions& options) {
  const auto count = static_cast<size_t>(options.turntable);
  return shown_durations(std::vector<double>(count, 1.0 / kDefaultFps), options.rate);
}

ImageSeries turntable_series(TaskRun& run, const std::filesystem::path& container,
                             const std::string& key, const RequestOptions& options) {
  return {view_durations(options.render),
          [&run, container, key, options](size_t index) -> Result<RenderImage> {
            RequestOptions turned = options;
            turned.render.azimuth_deg +=
                360.0 * static_cast<double>(index) / options.render.turntable;
            VOXELD_ASSIGN(const DrawnInput input, open_drawn(run, container, key));
            return take_image(run, input, key, turned);
          }};
}

std::vector<double> image_durations(const std::vector<double>& times_s, double fps,
                                    const RenderOptions& options) {
  return shown_durations(frame_durations(times_s, fps), options.rate);
}

Status begin_series(TaskRun& run, const std::vector<double>& durations_s,
                    const RenderOptions& options) {
  if (options.image != ImageKind::kSheet) {
    VOXELD_TRY(shown_times(options.image, durations_s));
    return {};
  }
  VOXELD_ASSIGN(const SheetLayout layout,
                sheet_layout(durations_s.size(), options.columns, options.width, options.height));
  // The pixels, and their PNG, which is as large if they are noise.
  expect_bytes(run, int64_t{2} * 4 * layout.columns * layout.width * layout.rows * layout.height);
  return {};
}

RenderOptions frame_camera(const GridSpec& spec, const RequestOptions& options) {
  RenderOptions render = options.render;
  const auto region = region_at_level(spec, options.output, 0);
  const CellBox box = region ? *region : CellBox{glm::ivec3(0), spec.dims};
  const Subject subject = box_subject(spec.world_from_grid(glm::dvec3(box.min)),
                                      spec.world_from_grid(glm::dvec3(box.max)));
  // A camera that the request gives stays, and the ground is the same for all frames, too.
  render.ground_y_world = subject.low_world.y;
  if (!render.matrix) render.matrix = row_major(make_camera(render, subject).clip_from_world);
  return render;
}

ImageSeries frame_series(TaskRun& run, const MadeSequence& sequence,
                         const RequestOptions& options) {
  std::vector<double> times_s;
  for (const SequenceFrame& frame : sequence.manifest.frames) times_s.push_back(frame.time_s);
  RequestOptions seen = options;
  seen.render = frame_camera(sequence_spec(sequence.manifest), options);
  return {image_durations(times_s, sequence.manifest.fps, options.render),
          [&run, &sequence, seen](size_t index) -> Result<RenderImage> {
            VOXELD_TRY(run.monitor.check());
            const std::string& key = sequence.manifest.frames[index].grid;
            VOXELD_ASSIGN(const DrawnInput input, open_drawn(run, sequence.paths[index], key));
            return take_image(run, input, key, seen);
          }};
}

Status write_image(TaskRun& run, const RenderImage& image) {
  const StageTimer stage(run, "encode");
  VOXELD_ASSIGN(const std::vector<uint8_t> png, encode_png(image));
  add_meta(run, {{"width", image.width}, {"height", image.height}});
  return add_output(run, "result", png, kPngMediaType, ".png");
}

Status write_series(TaskRun& run, const ImageSeries& series, const RenderOptions& options) {
  VOXELD_TRY(begin_series(run, series.durations_s, options));
  if (options.image == ImageKind::kSheet) return write_sheet(run, series, options);
  return write_animation(run, series, options);
}

}  // namespace voxeld
