#include "server/worker/images/image_task.h"

#include <string>
#include <utility>

#include "proto/text/number_text.h"
#include "server/formats/formats.h"
#include "server/voxel/frames/shared_frames.h"
#include "server/worker/frames/container_frames.h"
#include "server/worker/frames/frame_times.h"
#include "server/worker/frames/make_frames.h"
#include "server/worker/grids/grid_meta.h"
#include "server/worker/grids/make_grid.h"
#include "server/worker/grids/volume_input.h"
#include "server/worker/images/image_series.h"
#include "server/worker/task/asset_input.h"

namespace voxeld {
namespace {

bool is_animated(const RenderOptions& options) {
  return options.image != ImageKind::kPng;
}

Error not_animated() {
  return {ErrorCode::kInvalidOption, "image: there is one grid to show",
          "image=png, or frames of an animation, or turntable=N", "gif, apng or sheet"};
}

Error slices_sequence(int views) {
  return {ErrorCode::kInvalidOption, "turntable: of one grid, and not of a sequence",
          "a grid, or an animation at one time", std::to_string(views)};
}

// The frame of a sequence that a single image shows.
Result<size_t> shown_frame(const RenderOptions& options, size_t count) {
  if (options.frame >= 0 && static_cast<size_t>(options.frame) < count) {
    return static_cast<size_t>(options.frame);
  }
  return Error{ErrorCode::kInvalidOption, "frame: there are " + std::to_string(count) + " frames",
               index_text(count, "frames"), std::to_string(options.frame)};
}

// Draws a grid: one image, or a turntable.
Status draw_grid(TaskRun& run, const std::filesystem::path& container, const std::string& key,
                 const RequestOptions& options) {
  if (options.render.turntable > 0) {
    return write_series(run, turntable_series(run, container, key, options), options.render);
  }
  VOXELD_ASSIGN(const DrawnInput input, open_drawn(run, container, key));
  VOXELD_ASSIGN(const RenderImage image, take_image(run, input, key, options));
  return write_image(run, image);
}

// Writes the native container in the codec of stored grids.
Status write_grid(TaskRun& run, const Grid& grid) {
  const StageTimer stage(run, "encode");
  VOXELD_ASSIGN(const std::vector<uint8_t> container, encode(grid, OutputOptions{}));
  return add_output(run, "grid", container, format_media_type(Format::kNative),
                    format_extension(Format::kNative));
}

// The whole grid of a request, without level and region.
RequestOptions of_whole_grid(const RequestOptions& options) {
  RequestOptions all = options;
  all.output = {};
  return all;
}

// native container -> image. `key` is the grid's, which is not in the cache.
Status draw_made(TaskRun& run, WrittenGrid made, const std::string& key,
                 const RequestOptions& options) {
  std::erase_if(run.completion.outputs,
                [](const TaskOutput& output) { return output.role == "result"; });
  if (made.kept) keep_grid(run, made, key);
  return draw_grid(run, made.path, key, options);
}

// scene -> native container -> image
Status draw_scene(TaskRun& run, const SceneInput& scene, const std::string& key,
                  const RequestOptions& options) {
  run.engine.cache.grid.reset();
  VOXELD_ASSIGN(WrittenGrid made, voxelize_to_file(run, scene, of_whole_grid(options)));
  return draw_made(run, std::move(made), key, options);
}

// file of voxels -> native container -> image
Status draw_volume(TaskRun& run, const std::string& key, const RequestOptions& options) {
  run.engine.cache.grid.reset();
  VOXELD_ASSIGN(WrittenGrid made, volume_to_file(run, of_whole_grid(options)));
  return draw_made(run, std::move(made), key, options);
}

// Whether the cache has the grid of `key`; if so, lists its container.
Result<bool> write_cached_grid(TaskRun& run, const std::string& key) {
  const InputCache& cache = run.engine.cache;
  if (cache.grid == nullptr || cache.grid_key != key) return false;
  add_input_meta(run, cache.grid->grid.meta);
  VOXELD_TRY(write_grid(run, cache.grid->grid));
  return true;
}

Status render_still(TaskRun& run, const RequestOptions& options) {
  const std::string key = render_key(run.task, options);
  VOXELD_ASSIGN(const bool is_cached, write_cached_grid(run, key));
  if (is_cached) return draw_grid(run, {}, key, options);
  if (options.render.turntable > 0) {
    VOXELD_TRY(begin_series(run, view_durations(options.render), options.render));
  }
  VOXELD_ASSIGN(const bool is_volume, is_volume_input(run.task));
  if (is_volume) return draw_volume(run, key, options);
  VOXELD_ASSIGN(const auto scene, load_input_scene(run, load_options(options.voxelize)));
  return draw_scene(run, {*scene, scene_key(run.task, false)}, key, options);
}

// Renders one frame, placed and seen like all of them, or the animation at one time.
Status render_moment(TaskRun& run, const RequestOptions& options) {
  const bool is_frame = options.animation.is_sequence();
  std::string key = render_key(run.task, options);
  if (is_frame) key += " frame " + std::to_string(options.render.frame);
  VOXELD_ASSIGN(Clip clip, open_clip(run, options));
  VOXELD_ASSIGN(const size_t shown, shown_frame(options.render, clip.times.times_s.size()));
  const double time_s = clip.times.times_s[shown];
  add_meta(run, {{"animation", animation_facts(clip)}, {"time_s", time_s}});
  RequestOptions seen = options;
  if (is_frame) seen.render = frame_camera(clip.spec, options);
  VOXELD_ASSIGN(const bool is_cached, write_cached_grid(run, key));
  if (is_cached) return draw_grid(run, {}, key, seen);
  FrameVertices vertices;
  VOXELD_TRY(clip.moving.skin(time_s, vertices));
  clip.moving.show(vertices);
  SharedFrames frames(clip.spec);
  const SceneInput scene{clip.moving.scene(), key, &frames};
  // A cancelled task leaves by an exception.
  struct FramesEnd {
    ~FramesEnd() { voxelizer.end_frames(); }
    Voxelizer& voxelizer;
  };
  const FramesEnd end{run.engine.voxelizer};
  return draw_scene(run, scene, key, seen);
}

// asset -> sequence -> images of its frames
Status render_frames(TaskRun& run, const RequestOptions& options) {
  VOXELD_ASSIGN(Clip clip, open_clip(run, options));
  VOXELD_TRY(begin_series(run, image_durations(clip.times.times_s, clip.times.fps, options.render),
                          options.render));
  run.engine.cache.grid.reset();
  VOXELD_ASSIGN(const MadeSequence made, make_frames(run, clip, options));
  return write_series(run, frame_series(run, made, options), options.render);
}

Status render_mesh(TaskRun& run) {
  VOXELD_ASSIGN(const RequestOptions options, task_options(run.task, OptionScope::kRenderMesh));
  const bool is_sequence = options.animation.is_sequence();
  if (is_sequence && options.render.turntable > 0) return slices_sequence(options.render.turntable);
  if (is_animated(options.render) && !is_sequence && options.render.turntable == 0) {
    return not_animated();
  }
  VOXELD_ASSIGN(const bool is_volume, is_volume_input(run.task));
  if (is_volume || !options.animation.moves()) return render_still(run, options);
  return is_sequence && is_animated(options.render) ? render_frames(run, options)
                                                    : render_moment(run, options);
}

// Draws frames of an existing sequence.
Status render_sequence(TaskRun& run, const RequestOptions& options) {
  if (options.render.turntable > 0) return slices_sequence(options.render.turntable);
  VOXELD_ASSIGN(const MadeSequence sequence, open_sequence(run, options.animation));
  const ImageSeries series = frame_series(run, sequence, options);
  if (is_animated(options.render)) return write_series(run, series, options.render);
  VOXELD_ASSIGN(const size_t shown, shown_frame(options.render, sequence.paths.size()));
  add_meta(run, {{"time_s", sequence.manifest.frames[shown].time_s}});
  VOXELD_ASSIGN(const RenderImage image, series.take(shown));
  return write_image(run, image);
}

Status render_grid(TaskRun& run, const RequestOptions& options) {
  VOXELD_TRY(check_one_grid(options.animation));
  if (is_animated(options.render) && options.render.turntable == 0) return not_animated();
  const std::string& key = run.task.input_hash;
  {
    const StageTimer stage(run, "parse");
    VOXELD_ASSIGN(const DrawnInput input, open_drawn(run, run.task.input_path, key));
    add_input_meta(run, input.tiles().grid().meta);
  }
  return draw_grid(run, run.task.input_path, key, options);
}

}  // namespace

Status render(TaskRun& run) {
  if (!run.task.input_is_grid && !run.task.input_is_sequence) return render_mesh(run);
  VOXELD_ASSIGN(const RequestOptions options, task_options(run.task, OptionScope::kRenderGrid));
  return run.task.input_is_sequence ? render_sequence(run, options) : render_grid(run, options);
}

}  // namespace voxeld
