#include "server/worker/container_frames.h"

#include <algorithm>
#include <utility>

#include "proto/sequence_format.h"
#include "server/base/file.h"
#include "server/formats/sequence_formats.h"
#include "server/grid/region.h"
#include "server/worker/frame_times.h"
#include "server/worker/grid_input.h"

namespace voxeld {
namespace {

using nlohmann::json;

json parsed_meta(const std::string& text) {
  json meta = json::parse(text, nullptr, false);
  return meta.is_object() ? meta : json::object();
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
  VOXELD_ASSIGN(const FrameRange range, select_frames(options.frames, all.manifest.frames.size()));
  MadeSequence selected;
  selected.manifest = std::move(all.manifest);
  std::vector<SequenceFrame>& frames = selected.manifest.frames;
  frames.erase(frames.begin() + static_cast<std::ptrdiff_t>(range.end), frames.end());
  frames.erase(frames.begin(), frames.begin() + static_cast<std::ptrdiff_t>(range.begin));
  for (size_t k = range.begin; k < range.end; ++k) {
    selected.paths.emplace_back(run.task.frame_paths[k]);
  }
  json meta = parsed_meta(selected.manifest.meta_json);
  meta["frames"] = frames.size();
  selected.manifest.meta_json = meta.dump(-1, ' ', false, json::error_handler_t::replace);
  add_input_meta(run, selected.manifest.meta_json);
  return selected;
}

Result<ContainerFrames> ContainerFrames::open(TaskRun& run, const MadeSequence& sequence,
                                              const OutputOptions& output) {
  ContainerFrames source(run, sequence, output);
  const GridSpec spec = sequence_spec(sequence.manifest);
  VOXELD_ASSIGN(source.common_.spec, selected_spec(spec, output));
  source.common_.channels = sequence.manifest.channels;
  json meta = parsed_meta(sequence.manifest.meta_json);
  if (selects(output)) {
    Grid whole;
    whole.spec = spec;
    meta.update(selection_facts(whole, output));
    json place = grid_facts(source.common_, 0, "");
    for (const char* name : {"dims", "origin", "voxel_size"}) meta[name] = place[name];
  }
  source.common_.meta_json = meta.dump(-1, ' ', false, json::error_handler_t::replace);
  return source;
}

Result<Grid> ContainerFrames::frame(size_t index) const {
  VOXELD_ASSIGN(const auto input, GridInput::open(*run_, sequence_->paths[index]));
  VOXELD_ASSIGN(const Selection selection, Selection::open(input->tiles(), output_));
  Grid grid = selection.tiles().grid();
  VOXELD_TRY(for_each_batch(selection.tiles(), [&](std::vector<SparseTile> batch) -> Status {
    for (SparseTile& tile : batch) grid.tiles.push_back(std::move(tile));
    return {};
  }));
  return grid;
}

Status write_frames(TaskRun& run, const MadeSequence& sequence, const OutputOptions& output) {
  const StageTimer stage(run, "encode");
  VOXELD_ASSIGN(const ContainerFrames source, ContainerFrames::open(run, sequence, output));
  VOXELD_TRY(check_sequence_encodable(source.common().spec, source.frame_count(), output));
  add_warnings(run, sequence_warnings(source.common().spec, source.frame_count(), output));
  const std::filesystem::path path = next_output(run);
  VOXELD_TRY(write_sequence(source, output, path));
  list_output(run, path, "result", sequence_media_type(output.format),
              sequence_extension(output.format));
  return run.monitor.check();
}

}  // namespace voxeld
