#include "server/worker/run_task.h"

#include <new>
#include <utility>

#include "proto/messages/task_bounds.h"
#include "server/base/cancel_point.h"
#include "server/base/check.h"
#include "server/base/log.h"
#include "server/base/sha256.h"
#include "server/formats/formats.h"
#include "server/process/machine.h"
#include "server/voxel/estimates/estimate.h"
#include "server/worker/frames/container_frames.h"
#include "server/worker/frames/make_frames.h"
#include "server/worker/grids/grid_input.h"
#include "server/worker/grids/grid_meta.h"
#include "server/worker/grids/host_estimate.h"
#include "server/worker/grids/make_grid.h"
#include "server/worker/grids/volume_input.h"
#include "server/worker/images/image_task.h"
#include "server/worker/mesh/inspect.h"
#include "server/worker/task/asset_input.h"
#include "server/worker/task/cancel_watch.h"
#include "server/worker/task/task_run.h"

namespace voxeld {
namespace {

// Below this, returning memory to the system costs more than it saves.
constexpr int64_t kTrimBytesMin = int64_t{512} << 20;
constexpr std::string_view kJsonMediaType = "application/json";

// Writes the result from the grid whose container was made, unless that is the result.
Status write_made(TaskRun& run, WrittenGrid& made, const RequestOptions& options) {
  const bool is_selection = is_made_from_tiles(options.output);
  if (is_selection) {
    VOXELD_ASSIGN(const auto input, GridInput::open(run, made.path));
    VOXELD_TRY(write_selection(run, input->tiles(), options.output));
  }
  if (!made.kept) return {};
  if (options.output.format != Format::kNative && !is_selection) {
    const StageTimer stage(run, "encode");
    VOXELD_TRY(write_result(run, made.kept->grid, options.output));
  }
  keep_grid(run, made, made.id);
  return {};
}

// asset -> scene -> tiles -> native container -> grid -> the response's format
Status voxelize_scene(TaskRun& run, const SceneInput& scene, const RequestOptions& options) {
  run.engine.cache.grid.reset();
  VOXELD_ASSIGN(WrittenGrid made, voxelize_to_file(run, scene, options));
  return write_made(run, made, options);
}

// file of voxels -> native container -> grid -> the response's format
Status convert_volume(TaskRun& run, const RequestOptions& options) {
  run.engine.cache.grid.reset();
  VOXELD_ASSIGN(WrittenGrid made, volume_to_file(run, options));
  return write_made(run, made, options);
}

// Voxelizes an animation at one time.
Status voxelize_moment(TaskRun& run, const RequestOptions& options) {
  VOXELD_ASSIGN(Clip clip, open_clip(run, options));
  const double time_s = clip.times.times_s.front();
  FrameVertices vertices;
  VOXELD_TRY(clip.moving.skin(time_s, vertices));
  clip.moving.show(vertices);
  add_meta(run, {{"animation", animation_facts(clip)}, {"time_s", time_s}});
  return voxelize_scene(run, {clip.moving.scene(), render_key(run.task, options)}, options);
}

// asset -> frames -> containers -> the response's format
Status voxelize_frames(TaskRun& run, const RequestOptions& options) {
  VOXELD_ASSIGN(Clip clip, open_clip(run, options));
  VOXELD_ASSIGN(const GridSpec selected, selected_spec(clip.spec, options.output));
  VOXELD_TRY(check_sequence_encodable(selected, clip.times.times_s.size(), options.output));
  VOXELD_TRY(
      check_channels(wanted_channels(clip.moving.bind(), options.voxelize).grid, options.output));
  run.engine.cache.grid.reset();
  if (SequenceBeside::fits(options.output)) {
    SequenceBeside sequence(run, options.output);
    VOXELD_TRY(make_frames(run, clip, options, &sequence));
    return sequence.finish();
  }
  VOXELD_ASSIGN(const MadeSequence made, make_frames(run, clip, options));
  return write_frames(run, made, options.output);
}

Status voxelize(TaskRun& run) {
  VOXELD_ASSIGN(const RequestOptions options, task_options(run.task, OptionScope::kVoxelize));
  VOXELD_ASSIGN(const bool is_volume, is_volume_input(run.task));
  if (is_volume) return convert_volume(run, options);
  if (options.animation.is_sequence()) return voxelize_frames(run, options);
  if (options.animation.moves()) return voxelize_moment(run, options);
  VOXELD_ASSIGN(const auto scene, load_input_scene(run, load_options(options.voxelize)));
  return voxelize_scene(run, {*scene, scene_key(run.task, false)}, options);
}

// sequence -> the selected frames in the request's format
Status export_sequence(TaskRun& run, const RequestOptions& options) {
  VOXELD_ASSIGN(const MadeSequence sequence, open_sequence(run, options.animation));
  return write_frames(run, sequence, options.output);
}

// grid -> the grid, or a selection of it, in another format
Status export_grid(TaskRun& run) {
  VOXELD_ASSIGN(const RequestOptions options, task_options(run.task, OptionScope::kExport));
  if (run.task.input_is_sequence) return export_sequence(run, options);
  VOXELD_TRY(check_one_grid(options.animation));
  if (is_made_from_tiles(options.output) || options.output.format == Format::kNative) {
    VOXELD_ASSIGN(const auto input, GridInput::open(run, run.task.input_path));
    add_input_meta(run, input->tiles().grid().meta);
    return write_selection(run, input->tiles(), options.output);
  }
  VOXELD_ASSIGN(const auto grid, load_input_grid(run));
  VOXELD_TRY(check_encodable(grid->grid.spec, options.output));
  VOXELD_TRY(check_channels(grid->grid.channels, options.output));
  add_meta(run, grid_facts(*grid));
  const StageTimer stage(run, "encode");
  return write_result(run, grid->grid, options.output);
}

// Loads the scene for a description. If its animations are broken, it loads the mesh alone and adds
// the error as a warning.
Result<std::shared_ptr<const AnimatedScene>> load_described(TaskRun& run) {
  auto animated = load_input_animated(run, {.decode_images = false});
  if (animated || animated.error().code == ErrorCode::kCancelled) return animated;
  auto still = load_input_scene(run, {.decode_images = false});
  if (!still) return animated;
  add_warnings(run, {{"broken-animation", animated.error().message()}});
  auto described = std::make_shared<AnimatedScene>();
  described->scene = **still;
  return std::shared_ptr<const AnimatedScene>(std::move(described));
}

// asset -> description
Status inspect(TaskRun& run) {
  VOXELD_ASSIGN(const bool is_volume, is_volume_input(run.task));
  if (is_volume) {
    VOXELD_ASSIGN(const nlohmann::json description, describe_volume_input(run));
    add_meta(run, description);
  } else {
    VOXELD_ASSIGN(const auto animated, load_described(run));
    const StageTimer stage(run, "inspect");
    add_meta(run, describe_scene(*animated));
  }
  add_meta(run, {{"warnings", describe_warnings(run.completion.warnings)}});
  const std::string text = meta_text(run);
  return add_output(run, "result", {reinterpret_cast<const uint8_t*>(text.data()), text.size()},
                    kJsonMediaType, ".json");
}

Status run_kind(TaskRun& run) {
  switch (run.task.kind) {
    case JobKind::kVoxelize:
      return voxelize(run);
    case JobKind::kRender:
      return render(run);
    case JobKind::kExport:
      return export_grid(run);
    case JobKind::kInspect:
      return inspect(run);
  }
  VOXELD_CHECK(false, "job kinds are checked when the task is parsed");
}

// Runs the task with every exception caught.
Status run_caught(TaskRun& run) {
  const PeakMemory peak;
  try {
    add_meta(run, {{"source_hash", run.task.input_hash}});
    VOXELD_TRY(run_kind(run));
    add_meta(run, {{"host_bytes_peak", peak.bytes()}});
    return {};
  } catch (const Cancelled&) {
    return Error{ErrorCode::kCancelled, "the job was cancelled", "", ""};
  } catch (const std::bad_alloc&) {
    run.engine.cache = {};  // frees as much as it can
    return Error{ErrorCode::kGridTooLarge, "the server ran out of memory for this request", "", ""};
  } catch (const std::exception& failure) {
    run.engine.cache = {};
    return Error{ErrorCode::kInternal, std::string("unexpected failure: ") + failure.what(), "",
                 ""};
  }
}

// Runs the task with its cancel flag installed, and reports where a cancel would have come late.
Status run_guarded(TaskRun& run) {
  const CancelScope scope(run.monitor.cancel_flag(), &run.slice.pause());
  const CancelWatch watch(
      scope, [&run] { return run.monitor.progress().stage; }, [&run] { run.slice.tick(); });
  Status done = run_caught(run);
  const CancelWatch::Distance longest = watch.longest();
  if (longest.ms > CancelWatch::kDistanceMsMax) {
    log::warn("a cancellation point came late",
              {{"job", run.task.id}, {"stage", longest.stage}, {"ms", longest.ms}});
  }
  return done;
}

// Texts of an error are cut to what the task API carries.
TaskFailure failure_of(const Task& task, Error error) {
  for (std::string* text : {&error.detail, &error.expected, &error.got}) {
    if (text->size() > limits::kTaskTextBytesMax) text->resize(limits::kTaskTextBytesMax);
  }
  return {task.id, task.fence, std::move(error)};
}

}  // namespace

TaskOutcome run_task(Engine& engine, const Task& task, const std::filesystem::path& scratch,
                     TaskMonitor& monitor, SliceClient* slices) {
  TaskRun run{engine, task, scratch, monitor, {}, DeviceSlice(slices, task)};
  run.completion.task = task.id;
  run.completion.fence = task.fence;
  // Return memory that a large earlier task freed, so it does not count as this task's.
  if (resident_bytes() > kTrimBytesMin) release_free_memory();
  Status done = run_guarded(run);
  if (!done && run.preempted) {
    run.preempted->timings = std::move(run.completion.timings);
    return *std::move(run.preempted);
  }
  if (!done) return failure_of(task, std::move(done).error());
  run.completion.meta_json = meta_text(run);
  // The gateway would take a completion out of bounds for one of a hijacked worker.
  if (const Status bounded = check_bounds(run.completion); !bounded) {
    return failure_of(
        task, {ErrorCode::kInternal,
               "the result is not one that can be reported: " + bounded.error().message(), "", ""});
  }
  return std::move(run.completion);
}

}  // namespace voxeld
