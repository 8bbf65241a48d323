#include "server/worker/frames/container_frames.h"

#include <algorithm>
#include <glm/common.hpp>
#include <utility>

#include "proto/container/sequence_format.h"
#include "server/base/disk/file.h"
#include "server/formats/formats.h"
#include "server/grid/content_hash.h"
#include "server/grid/region.h"
#include "server/worker/frames/frame_times.h"
#include "server/worker/grids/grid_input.h"
#include "server/worker/grids/grid_meta.h"
#include "server/worker/grids/host_estimate.h"

namespace voxeld {
namespace {

using nlohmann::json;

// Adds the frame's number to an error about its container.
Error of_frame(size_t frame, Error error) {
  if (error.code == ErrorCode::kBadRequest) {
    error.detail = "frame " + std::to_string(frame) + ": " + error.detail;
  }
  return error;
}

Result<Grid> selected_grid(TaskRun& run, const std::filesystem::path& container,
                           const OutputOptions& asked, const CellBox& crop) {
  VOXELD_ASSIGN(const auto input, GridInput::open(run, container));
  const GridSpec& whole = input->tiles().grid().spec;
  const OutputOptions output = asked.crop ? crop_to(asked, whole, crop) : asked;
  VOXELD_ASSIGN(const Selection selection, Selection::open(input->tiles(), asked, crop));
  Grid grid = selection.tiles().grid();
  VOXELD_TRY(for_each_batch(selection.tiles(), [&](std::vector<SparseTile> batch) -> Status {
    for (SparseTile& tile : batch) grid.tiles.push_back(std::move(tile));
    return {};
  }));
  if (selects(output)) {
    json facts = selection_facts(input->tiles().grid(), output);
    facts.update(grid_facts(grid, grid.voxel_count(), content_hash(grid)));
    grid.meta = grid.meta.with(facts);
  }
  return grid;
}

// The box of the cells that are occupied in any frame, as occupied_selection().
Result<CellBox> occupied_by_all(TaskRun& run, const MadeSequence& sequence,
                                const OutputOptions& output) {
  CellBox all;
  for (size_t i = 0; i < sequence.paths.size(); ++i) {
    VOXELD_ASSIGN(const auto input, GridInput::open(run, sequence.paths[i]));
    auto box = occupied_selection(input->tiles(), output);
    if (!box) return of_frame(i, std::move(box).error());
    if (box->empty()) continue;
    all = all.empty() ? *box : CellBox{glm::min(all.min, box->min), glm::max(all.max, box->max)};
  }
  return all;
}

// Upper bound of a frame in memory, with the worst case of few voxels per brick, and its
// attributes.
int64_t largest_sequence_bytes(const SequenceManifest& manifest) {
  constexpr int64_t kOccupancyBytes = 16;
  uint64_t voxels = 0;
  for (const SequenceFrame& frame : manifest.frames) voxels = std::max(voxels, frame.voxel_count);
  return sequence_bytes(
      static_cast<int64_t>(voxels) *
      (kOccupancyBytes + static_cast<int64_t>(attribute_bytes(manifest.channels))));
}

// Lists a written sequence as the result.
Status list_sequence(TaskRun& run, const std::filesystem::path& path, const Grid& common,
                     size_t frames, const OutputOptions& output) {
  add_warnings(run, sequence_warnings(common, frames, output));
  list_output(run, path, "result", sequence_media_type(output.format),
              sequence_extension(output.format));
  return run.monitor.check();
}

}  // namespace

GridSpec sequence_spec(const SequenceManifest& manifest) {
  GridSpec spec;
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = static_cast<size_t>(axis);
    spec.dims[axis] = manifest.dims[at];
    spec.origin_world[axis] = manifest.origin[at];
    spec.voxel_size[axis] = manifest.voxel_size[at];
  }
  return spec;
}

Result<MadeSequence> open_sequence(TaskRun& run, const AnimationOptions& options) {
  const StageTimer stage(run, "parse");
  VOXELD_ASSIGN(const std::vector<uint8_t> bytes, read_file(run.task.input_path));
  MadeSequence all;
  VOXELD_ASSIGN(all.manifest,
                parse_sequence({reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
  if (all.manifest.frames.size() != run.task.frame_paths.size()) {
    return Error{ErrorCode::kInternal, "the sequence's containers are not those of its manifest",
                 std::to_string(all.manifest.frames.size()) + " containers",
                 std::to_string(run.task.frame_paths.size())};
  }
  VOXELD_ASSIGN(const FrameSelection range,
                select_frames(options.frames, all.manifest.frames.size()));
  MadeSequence selected;
  selected.manifest = std::move(all.manifest);
  std::vector<SequenceFrame>& frames = selected.manifest.frames;
  frames.erase(frames.begin() + static_cast<std::ptrdiff_t>(range.end), frames.end());
  frames.erase(frames.begin(), frames.begin() + static_cast<std::ptrdiff_t>(range.begin));
  for (size_t k = range.begin; k < range.end; ++k) {
    selected.paths.emplace_back(run.task.frame_paths[k]);
  }
  const GridMeta meta =
      GridMeta::parse(selected.manifest.meta_json).with({{"frames", frames.size()}});
  selected.manifest.meta_json = meta.text();
  add_input_meta(run, meta);
  return selected;
}

Result<ContainerFrames> ContainerFrames::open(TaskRun& run, const MadeSequence& sequence,
                                              const OutputOptions& asked) {
  const GridSpec spec = sequence_spec(sequence.manifest);
  VOXELD_TRY(check_channels(sequence.manifest.channels, asked));
  OutputOptions output = asked;
  ContainerFrames source(run, sequence, asked);
  if (asked.crop) {
    VOXELD_ASSIGN(source.crop_, occupied_by_all(run, sequence, asked));
    output = crop_to(asked, spec, source.crop_);
  }
  VOXELD_ASSIGN(source.common_.spec, selected_spec(spec, output));
  source.common_.channels = sequence.manifest.channels;
  source.common_.meta = GridMeta::parse(sequence.manifest.meta_json);
  if (selects(output)) {
    Grid whole;
    whole.spec = spec;
    whole.meta = source.common_.meta;
    json facts = selection_facts(whole, output);
    facts.update(place_facts(source.common_.spec));
    source.common_.meta = source.common_.meta.with(facts);
  }
  return source;
}

Result<Grid> ContainerFrames::frame(size_t index) const {
  auto grid = selected_grid(*run_, sequence_->paths[index], output_, crop_);
  if (!grid) return of_frame(index, std::move(grid).error());
  return grid;
}

std::optional<std::filesystem::path> ContainerFrames::container(size_t index) const {
  if (selects(output_)) return std::nullopt;
  return sequence_->paths[index];
}

Status ContainerFrames::before_tiles(size_t done, size_t total) const {
  (void)run_->monitor.set_progress(static_cast<int64_t>(done), static_cast<int64_t>(total));
  return run_->monitor.check();
}

Status write_frames(TaskRun& run, const MadeSequence& sequence, const OutputOptions& output) {
  const StageTimer stage(run, "encode");
  VOXELD_ASSIGN(const ContainerFrames source, ContainerFrames::open(run, sequence, output));
  const Grid& common = source.common();
  VOXELD_TRY(check_sequence_encodable(common.spec, source.frame_count(), output));
  VOXELD_TRY(check_channels(common.channels, output));
  if (SequenceBeside::fits(output)) expect_bytes(run, largest_sequence_bytes(sequence.manifest));
  const std::filesystem::path path = next_output(run);
  VOXELD_TRY(write_sequence(source, output, path));
  return list_sequence(run, path, common, source.frame_count(), output);
}

bool SequenceBeside::fits(const OutputOptions& output) {
  return output.format == Format::kNative && !selects(output);
}

Status SequenceBeside::begin(const SequenceManifest& manifest) {
  common_.spec = sequence_spec(manifest);
  common_.channels = manifest.channels;
  common_.meta = GridMeta::parse(manifest.meta_json);
  path_ = run_.scratch / (run_.task.id + "-sequence");
  VOXELD_ASSIGN(file_, NativeSequence::create(common_, manifest.fps, output_.codec, path_));
  return {};
}

Status SequenceBeside::frame(double time_s, const std::filesystem::path& container) {
  ++frame_count_;
  return side_.push(0, [this, time_s, container] {
    return file_->add_container(
        time_s, container, [this](size_t done, size_t total) { return before_tiles(done, total); });
  });
}

// Runs on a thread of the pool.
Status SequenceBeside::before_tiles(size_t done, size_t total) {
  if (!is_wanted_) return Error{ErrorCode::kCancelled, "the sequence is not wanted", "", ""};
  if (is_last_stage_) {
    (void)run_.monitor.set_progress(static_cast<int64_t>(done), static_cast<int64_t>(total));
  }
  return run_.monitor.check();
}

Status SequenceBeside::finish() {
  const StageTimer stage(run_, "encode");
  is_last_stage_ = true;
  VOXELD_TRY(side_.wait());
  VOXELD_TRY(file_->finish());
  return list_sequence(run_, path_, common_, frame_count_, output_);
}

}  // namespace voxeld
