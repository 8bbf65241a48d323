#include "server/worker/frames/make_frames.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "proto/container/grid_format.h"
#include "server/base/algorithm_version.h"
#include "server/base/disk/file.h"
#include "server/grid/grid_spec.h"
#include "server/voxel/frames/shared_frames.h"
#include "server/worker/grids/grid_file.h"
#include "server/worker/grids/grid_meta.h"
#include "server/worker/grids/host_estimate.h"
#include "server/worker/grids/make_grid.h"
#include "server/worker/task/asset_input.h"
#include "server/worker/task/mesh_report.h"
#include "server/worker/task/serial_queue.h"

namespace voxeld {
namespace {

using nlohmann::json;

// Bytes of tiles that wait to be encoded.
constexpr size_t kWaitingTileBytesMax = size_t{64} << 20;

size_t bytes_of(const std::vector<SparseTile>& tiles) {
  size_t bytes = 0;
  for (const SparseTile& tile : tiles) bytes += tile_bytes(tile);
  return bytes;
}

// Whether this version of the program would make the same container.
bool is_of_this_version(const std::string& path) {
  const auto file = MappedFile::open(path);
  const auto reader = file ? GridReader::open(file->bytes()) : file.error();
  if (!reader) return false;
  return GridMeta::parse(reader->header().meta_json).algorithm_version() == kAlgorithmVersion;
}

// Writes the meta of the frames' containers, which is equal for equal frames.
struct FrameMeta {
  const Task& task;
  const Scene& scene;  // the bind pose
  const RequestOptions& options;
  const std::optional<MeshTopology>& topology;
};

// Takes one frame from its first tile to its report. Work passed to `later` runs on the side
// thread.
class FrameOutput final : public TileSink, public std::enable_shared_from_this<FrameOutput> {
 public:
  FrameOutput(TaskRun& run, SerialQueue& side, size_t index, double time_s)
      : run_(run),
        side_(side),
        file_(run.scratch / (run.task.id + "-frame-" + std::to_string(index)),
              OutputOptions{}.codec),
        output_({&file_}, false, 0) {
    frame_.index = static_cast<int64_t>(index);
    frame_.time_s = time_s;
  }

  Status begin(const Grid& grid) override {
    return later(0, [grid](FrameOutput& self) { return self.output_.begin(grid); });
  }
  Status add(std::vector<SparseTile> tiles) override {
    const size_t bytes = bytes_of(tiles);
    // std::function copies its captures, so the tiles are shared.
    auto shared = std::make_shared<std::vector<SparseTile>>(std::move(tiles));
    return later(bytes,
                 [shared](FrameOutput& self) { return self.output_.add(std::move(*shared)); });
  }
  bool keeps_tiles() const override { return false; }

  Status finish(const FrameMeta& meta, std::optional<FillStats> fill, MadeSequence& made,
                FrameListener* listener) {
    return later(0, [&meta, fill = std::move(fill), &made, listener](FrameOutput& self) {
      return self.report(meta, fill, made, listener);
    });
  }

 private:
  template <typename Work>
  Status later(size_t bytes, Work work) {
    return side_.push(bytes, [self = shared_from_this(), work] { return work(*self); });
  }

  Status report(const FrameMeta& meta, const std::optional<FillStats>& fill, MadeSequence& made,
                FrameListener* listener) {
    frame_.content_hash = output_.finish_hash();
    frame_.voxel_count = output_.voxel_count();
    frame_.path = file_.path().string();
    const json facts = grid_facts(output_.grid(), frame_.voxel_count, frame_.content_hash);
    VOXELD_TRY(
        file_.finish(container_meta(meta.task, meta.scene, frame_grid_options(meta.options), facts,
                                    fill, meta.topology, meta.options.voxelize.labels)));
    VOXELD_ASSIGN(TaskFrameReply reply, run_.monitor.report_frame(frame_));
    made.manifest.frames.push_back(
        {frame_.time_s, std::move(reply.grid), frame_.voxel_count, frame_.content_hash});
    made.paths.emplace_back(std::move(reply.path));
    return listener == nullptr ? Status() : listener->frame(frame_.time_s, made.paths.back());
  }

  TaskRun& run_;
  SerialQueue& side_;
  TaskFrame frame_;
  GridFile file_;
  GridOutput output_;
};

// Voxelizes the frames of a clip one after the other.
class FrameLoop {
 public:
  FrameLoop(TaskRun& run, Clip& clip, const RequestOptions& options)
      : run_(run), clip_(clip), options_(options), shared_(clip.spec) {}
  ~FrameLoop() { run_.engine.voxelizer.end_frames(); }
  FrameLoop(const FrameLoop&) = delete;
  FrameLoop& operator=(const FrameLoop&) = delete;

  Result<MadeSequence> make(FrameListener* listener) {
    const std::vector<double>& times_s = clip_.times.times_s;
    MadeSequence made;
    MeshReport mesh(run_.engine.cache, scene_key(run_.task, false), clip_.moving.bind());
    const FrameMeta meta{run_.task, clip_.moving.bind(), options_, mesh.get()};
    describe(made, meta);
    if (listener != nullptr) VOXELD_TRY(listener->begin(made.manifest));
    // declared after the objects it writes to, so it is destroyed first
    SerialQueue side(kWaitingTileBytesMax), moving(0);
    VOXELD_ASSIGN(const size_t first, take_done(made, listener));
    VOXELD_TRY(move_later(moving, first));
    VOXELD_TRY(run_.slice.begin());
    const DeviceSlice::Scope slice(run_.slice);  // one time slice for all frames: a slice is longer
                                                 // than most frames
    for (size_t k = first; k < times_s.size(); ++k) {
      VOXELD_TRY(run_.monitor.check());
      run_.monitor.set_preemptible(k > first);
      if (k > first && run_.monitor.is_asked_to_preempt()) return preempt(side);
      VOXELD_TRY(moving.wait());
      show_next();
      if (k + 1 < times_s.size()) VOXELD_TRY(move_later(moving, k + 1));
      const auto output = std::make_shared<FrameOutput>(run_, side, k, times_s[k]);
      VOXELD_TRY(voxelize(*output));
      VOXELD_TRY(output->finish(meta, stats_.fill, made, listener));
    }
    run_.monitor.set_preemptible(false);
    run_.slice.end();
    VOXELD_TRY(side.wait());
    add_making_meta(run_, meta_, stats_);
    return made;
  }

 private:
  // A frame's pose, and its vertices unless a device is expected to move them.
  struct Moved {
    Pose pose;
    FrameVertices vertices;
    bool has_vertices = false;
  };

  // Takes over frames of an earlier attempt and returns their number. At least one frame is left to
  // make, because the response reports how it was made.
  Result<size_t> take_done(MadeSequence& made, FrameListener* listener) {
    const auto& times_s = clip_.times.times_s;
    const std::vector<TaskDoneFrame>& done = run_.task.done_frames;
    const size_t count = std::min(done.size(), times_s.size() - 1);
    for (size_t k = 0; k < count; ++k) {
      if (done[k].time_s != times_s[k] || !is_of_this_version(done[k].path)) return k;
      made.manifest.frames.push_back(
          {done[k].time_s, done[k].grid, done[k].voxel_count, done[k].content_hash});
      made.paths.emplace_back(done[k].path);
      if (listener != nullptr) VOXELD_TRY(listener->frame(done[k].time_s, made.paths.back()));
      run_.monitor.set_frames(static_cast<int64_t>(k) + 1, static_cast<int64_t>(times_s.size()));
    }
    return count;
  }

  // Preempts the task: the frames before this one are reported, and a later attempt makes the
  // others.
  Error preempt(SerialQueue& side) {
    run_.slice.end();
    const Status reported = side.wait();
    return reported ? voxeld::preempt(run_) : reported.error();
  }

  Status move_later(SerialQueue& moving, size_t k) {
    next_.has_vertices = !shared_.device_moves();
    return moving.push(0, [this, k]() -> Status {
      VOXELD_TRY(clip_.moving.find_pose(clip_.times.times_s[k], next_.pose));
      return next_.has_vertices ? clip_.moving.skin(next_.pose, next_.vertices) : Status();
    });
  }

  void show_next() {
    std::swap(pose_, next_.pose);
    if (next_.has_vertices) clip_.moving.show(next_.vertices);
    shared_.set_pose(clip_.moving.posed(pose_, next_.has_vertices));
  }

  Status voxelize(TileSink& sink) {
    stats_.fill.reset();
    Status made = run_.engine.voxelizer.voxelize(
        clip_.moving.scene(), options_.voxelize, &shared_, sink,
        [this](int64_t done, int64_t total) {
          return run_.monitor.set_progress(done, total) && !is_cancelled();
        },
        &stats_);
    note_device(run_.engine, stats_, made);
    return made;
  }

  // Fills in the manifest except its frames.
  void describe(MadeSequence& made, const FrameMeta& meta) {
    Grid common;
    common.spec = clip_.spec;
    common.channels = shared_.channels(meta.scene, options_.voxelize).grid;
    const glm::ivec3& dims = common.spec.dims;
    const glm::dvec3 &origin = common.spec.origin_world, &size = common.spec.voxel_size;
    made.manifest.dims = {dims.x, dims.y, dims.z};
    made.manifest.origin = {origin.x, origin.y, origin.z};
    made.manifest.voxel_size = {size.x, size.y, size.z};
    made.manifest.channels = common.channels;
    made.manifest.fps = clip_.times.fps;
    json facts = place_facts(common.spec);
    facts["channels"] = channel_facts(common.channels);
    facts["animation"] = animation_facts(clip_);
    facts["frames"] = clip_.times.times_s.size();
    facts["fps"] = clip_.times.fps;
    meta_ = container_meta(meta.task, meta.scene, grid_options(options_), facts, std::nullopt,
                           meta.topology, options_.voxelize.labels);
    made.manifest.meta_json = meta_.text();
  }

  TaskRun& run_;
  Clip& clip_;
  const RequestOptions& options_;
  SharedFrames shared_;
  Moved next_;
  Pose pose_;  // of the frame that is voxelized
  VoxelizeStats stats_;
  GridMeta meta_;  // of the sequence
};

}  // namespace

Result<Clip> open_clip(TaskRun& run, const RequestOptions& options) {
  VOXELD_ASSIGN(auto animated, load_input_animated(run, load_options(options.voxelize)));
  const PlacementOptions& placement = options.voxelize.placement;
  VOXELD_ASSIGN(MovingScene moving,
                MovingScene::open(std::move(animated), options.animation, placement.up));
  VOXELD_ASSIGN(FrameTimes times, frame_times(options.animation, moving.animation()));
  const StageTimer stage(run, "place");
  VOXELD_ASSIGN(const Box3d box, moving.box_over(times.times_s, world_from_file(placement),
                                                 [&] { return run.monitor.check(); }));
  if (box.empty()) return Error{ErrorCode::kEmptyMesh, "the mesh has no triangles", "", ""};
  VOXELD_ASSIGN(const GridSpec spec, place_grid(placement, box.min, box.max));
  return Clip{std::move(moving), std::move(times), spec};
}

json animation_facts(const Clip& clip) {
  const AnimationInfo& animation = clip.moving.animation();
  return {{"name", animation.name},
          {"number", clip.moving.animation_index()},
          {"duration_s", animation.duration_s},
          {"frame_rate", animation.frame_rate}};
}

Result<MadeSequence> make_frames(TaskRun& run, Clip& clip, const RequestOptions& options,
                                 FrameListener* listener) {
  VOXELD_TRY(check_cells(run.task, clip.spec, clip.times.times_s.size()));
  const Placed placed{world_from_file(options.voxelize.placement), clip.spec};
  const Scene& scene = clip.moving.bind();
  expect_bytes(
      run,
      voxelize_bytes(run.engine, scene, options, placed) +
          static_cast<int64_t>(kWaitingTileBytesMax) +
          (listener == nullptr ? 0
                               : sequence_bytes(grid_bytes(run.engine, scene, options, placed))),
      run.engine.voxelizer.device_bytes(scene, options.voxelize));
  run.monitor.set_frames(0, static_cast<int64_t>(clip.times.times_s.size()));
  Result<MadeSequence> made = Error{};
  {
    const StageTimer stage(run, "voxelize");
    made = FrameLoop(run, clip, options).make(listener);
  }
  if (!made) return made;
  const StageTimer stage(run, "encode");
  const std::string text = sequence_json(made->manifest);
  VOXELD_TRY(add_output(run, "sequence",
                        {reinterpret_cast<const uint8_t*>(text.data()), text.size()},
                        "application/json", ".json"));
  return made;
}

}  // namespace voxeld
