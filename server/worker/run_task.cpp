#include "server/worker/run_task.h"

#include <new>
#include <utility>

#include "server/base/check.h"
#include "server/base/host_memory.h"
#include "server/base/sha256.h"
#include "server/formats/formats.h"
#include "server/grid/region.h"
#include "server/worker/grid_input.h"
#include "server/worker/host_estimate.h"
#include "server/worker/inspect.h"
#include "server/worker/picture_grid.h"
#include "server/worker/task_run.h"

namespace voxeld {
namespace {

constexpr std::string_view kPngMediaType = "image/png";
// Below this, giving memory back costs more than it is worth.
constexpr int64_t kTrimBytesMin = int64_t{512} << 20;
constexpr std::string_view kJsonMediaType = "application/json";

// Writes the native container in the codec that grids are kept in.
Status write_grid(TaskRun& run, const Grid& grid) {
  const StageTimer stage(run, "encode");
  VOXELD_ASSIGN(const std::vector<uint8_t> container, encode_native(grid, OutputOptions{}));
  return add_output(run, "grid", container, format_media_type(Format::kNative),
                    format_extension(Format::kNative));
}

// Writes the grid in the format asked for.
Status write_result(TaskRun& run, const Grid& grid, const OutputOptions& output) {
  const StageTimer stage(run, "encode");
  VOXELD_ASSIGN(const std::vector<uint8_t> bytes, encode(grid, output));
  add_warnings(run, encode_warnings(grid.spec, output));
  return add_output(run, "result", bytes, format_media_type(output.format),
                    format_extension(output.format));
}

// Who has voxelized a mesh mostly looks at it next.
void keep_grid(TaskRun& run, WrittenGrid& made, const std::string& key) {
  run.engine.cache.grid = std::make_shared<const LoadedGrid>(std::move(*made.kept));
  run.engine.cache.grid_key = key;
}

// asset -> scene -> tiles -> native container; -> grid -> the answer's format
Status voxelize(TaskRun& run) {
  VOXELD_ASSIGN(const RequestOptions options, task_options(run.task, OptionScope::kVoxelize));
  VOXELD_ASSIGN(const auto scene, load_input_scene(run, true));
  run.engine.cache.grid.reset();
  VOXELD_ASSIGN(WrittenGrid made, voxelize_to_file(run, *scene, options));
  const bool is_selection = selects(options.output);
  if (is_selection) {
    VOXELD_ASSIGN(const auto input, GridInput::open(run, made.path));
    VOXELD_TRY(write_selection(run, input->tiles(), options.output));
  }
  if (!made.kept) return {};
  if (options.output.format != Format::kNative && !is_selection) {
    VOXELD_TRY(write_result(run, made.kept->grid, options.output));
  }
  keep_grid(run, made, made.id);
  return {};
}

// A grid to draw: in memory, or in its container.
struct DrawnInput {
  std::shared_ptr<const LoadedGrid> whole;
  std::unique_ptr<GridInput> container;
  std::unique_ptr<GridTiles> resident;
  const TileSource& tiles() const {
    return resident != nullptr ? static_cast<const TileSource&>(*resident) : container->tiles();
  }
};

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

// Draws the grid, or as much of it as is needed.
Status draw(TaskRun& run, const DrawnInput& input, const std::string& key,
            const RequestOptions& options) {
  expect_bytes(run, picture_bytes(run.engine, input.tiles(), options.render));
  VOXELD_ASSIGN(const PictureGrid drawn,
                picture_grid(run, input.tiles(), key, input.whole, options));
  VOXELD_ASSIGN(const Picture picture, render_picture(run, *drawn.grid, drawn.key, drawn.options));
  const StageTimer stage(run, "encode");
  VOXELD_ASSIGN(const std::vector<uint8_t> png, encode_png(picture));
  add_meta(run, {{"width", picture.width}, {"height", picture.height}});
  return add_output(run, "result", png, kPngMediaType, ".png");
}

// asset -> scene -> native container -> picture
Status render_mesh(TaskRun& run) {
  VOXELD_ASSIGN(RequestOptions options, task_options(run.task, OptionScope::kRenderMesh));
  InputCache& cache = run.engine.cache;
  const std::string key = render_key(run.task, options);
  if (cache.grid != nullptr && cache.grid_key == key) {
    add_input_meta(run, cache.grid->grid.meta_json);
    VOXELD_TRY(write_grid(run, cache.grid->grid));
    VOXELD_ASSIGN(const DrawnInput input, open_drawn(run, {}, key));
    return draw(run, input, key, options);
  }
  VOXELD_ASSIGN(const auto scene, load_input_scene(run, true));
  cache.grid.reset();
  RequestOptions all = options;  // of the grid
  all.output = {};
  VOXELD_ASSIGN(WrittenGrid made, voxelize_to_file(run, *scene, all));
  std::erase_if(run.completion.outputs,
                [](const TaskOutput& output) { return output.role == "result"; });
  if (made.kept) keep_grid(run, made, key);
  VOXELD_ASSIGN(const DrawnInput input, open_drawn(run, made.path, key));
  return draw(run, input, key, options);
}

Status render(TaskRun& run) {
  if (!run.task.input_is_grid) return render_mesh(run);
  VOXELD_ASSIGN(const RequestOptions options, task_options(run.task, OptionScope::kRenderGrid));
  DrawnInput input;
  {
    const StageTimer stage(run, "parse");
    VOXELD_ASSIGN(input, open_drawn(run, run.task.input_path, run.task.input_hash));
    add_input_meta(run, input.tiles().grid().meta_json);
  }
  return draw(run, input, run.task.input_hash, options);
}

// grid -> the grid in another format, or what is wanted of it
Status export_grid(TaskRun& run) {
  VOXELD_ASSIGN(const RequestOptions options, task_options(run.task, OptionScope::kExport));
  if (selects(options.output) || options.output.format == Format::kNative) {
    VOXELD_ASSIGN(const auto input, GridInput::open(run, run.task.input_path));
    add_input_meta(run, input->tiles().grid().meta_json);
    return write_selection(run, input->tiles(), options.output);
  }
  VOXELD_ASSIGN(const auto grid, load_input_grid(run));
  VOXELD_TRY(check_encodable(grid->grid.spec, options.output));
  add_meta(run, grid_facts(*grid));
  return write_result(run, grid->grid, options.output);
}

// asset -> description
Status inspect(TaskRun& run) {
  VOXELD_ASSIGN(const auto scene, load_input_scene(run, false));
  const StageTimer stage(run, "inspect");
  add_meta(run, describe_scene(*scene));
  nlohmann::json warnings = nlohmann::json::array();
  for (const Warning& warning : run.completion.warnings) {
    warnings.push_back({{"code", warning.code}, {"detail", warning.detail}});
  }
  add_meta(run, {{"warnings", warnings}});
  const std::string& text = run.completion.meta_json;
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

}  // namespace

Result<TaskCompletion> run_task(Engine& engine, const Task& task,
                                const std::filesystem::path& scratch, TaskMonitor& monitor) {
  TaskRun run{engine, task, scratch, monitor, {}};
  run.completion.task = task.id;
  run.completion.fence = task.fence;
  // What a large task before this one freed is not this one's.
  if (resident_bytes() > kTrimBytesMin) release_free_memory();
  const PeakMemory peak;
  try {
    add_meta(run, {{"source_hash", task.input_hash}});
    VOXELD_TRY(run_kind(run));
    add_meta(run, {{"host_bytes_peak", peak.bytes()}});
    return std::move(run.completion);
  } catch (const std::bad_alloc&) {
    engine.cache = {};  // gives back what it can
    return Error{ErrorCode::kGridTooLarge, "the server ran out of memory for this request", "", ""};
  } catch (const std::exception& failure) {
    engine.cache = {};
    return Error{ErrorCode::kInternal, std::string("unexpected failure: ") + failure.what(), "",
                 ""};
  }
}

}  // namespace voxeld
