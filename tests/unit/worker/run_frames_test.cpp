// Tasks of animations from end to end in the worker, against a gateway that keeps the frames.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "proto/container/sequence_format.h"
#include "proto/messages/sequence.h"
#include "server/base/algorithm_version.h"
#include "server/base/disk/file.h"
#include "server/base/sha256.h"
#include "server/grid/content_hash.h"
#include "server/grid/grid.h"
#include "server/worker/run_task.h"
#include "tests/fixtures/samples.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/worker/fake_gateway.h"
#include "tests/unit/worker/task_completion.h"

namespace voxeld {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

std::string id_of(const fs::path& path) {
  const auto bytes = read_file(path);
  EXPECT_TRUE(bytes.ok());
  return sha256_id(*bytes);
}

// A worker on the CPU, and what the gateway has heard of its task.
class FramesTest : public ::testing::Test {
 protected:
  FramesTest() : engine_(open_device(gpu::DeviceId{.kind = gpu::DeviceKind::kCpu}, "").value()) {
    write("worm.md5.zip", fixtures::animated_md5_zip());
    write("spin.glb", fixtures::animated_glb());
    for (const auto& [name, bytes] : fixtures::animated_md5_files()) write(name, bytes);
  }

  void write(const std::string& name, const fixtures::Bytes& bytes) {
    std::ofstream out(dir_.path() / name, std::ios::binary);
    out.write(reinterpret_cast<const char*>(bytes.data()),
              static_cast<std::streamsize>(bytes.size()));
  }

  Task task(JobKind kind, const std::string& name, const json& options) {
    Task task;
    task.id = "j-" + std::to_string(++tasks_);
    task.fence = 1;
    task.kind = kind;
    task.input_path = (dir_.path() / name).string();
    task.input_hash = id_of(task.input_path);
    task.filename = name;
    task.options_json = options.dump();
    return task;
  }

  // The last byte is part of a checksum.
  static void break_last_byte(const fs::path& path) {
    std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
    file.seekg(-1, std::ios::end);
    const auto byte = static_cast<char>(file.get() ^ 0x20);
    file.seekp(-1, std::ios::end);
    file.put(byte);
  }

  // Whether a sequence is in the scratch directory, whole or not.
  bool has_sequence_file() const {
    const auto is_one = [](const fs::directory_entry& entry) {
      return entry.path().filename().string().ends_with("-sequence");
    };
    return std::any_of(fs::directory_iterator(dir_.path()), fs::directory_iterator(), is_one);
  }

  // The gateway's part of a frame: its container moves into the store.
  std::string take(const json& message) {
    if (message["type"] != "frame") return R"({"cancel":false,"fenced":false})";
    const fs::path from = message["path"].get<std::string>();
    const std::string id = id_of(from);
    const fs::path to = dir_.path() / (id + ".voxg");
    fs::rename(from, to);
    if (static_cast<int>(frames_.size()) == breaks_) break_last_byte(to);
    frames_.push_back(message);
    frames_.back()["grid"] = id;
    const bool cancel = cancel_after_ > 0 && static_cast<int>(frames_.size()) >= cancel_after_;
    return json{{"cancel", cancel}, {"fenced", false}, {"grid", id}, {"path", to.string()}}.dump();
  }

  Result<TaskCompletion> run(const Task& task, SliceClient* slices = nullptr) {
    frames_.clear();
    testing::FakeGateway gateway([this](const json& message) { return take(message); });
    auto client = TaskClient::connect(gateway.address()).value();
    TaskMonitor monitor(*client, task);
    return testing::completion_of(run_task(engine_, task, dir_.path(), monitor, slices));
  }

  // The memory that the task's first time slice asks for; it gets none.
  int64_t bytes_asked(const Task& task) {
    int64_t bytes = 0;
    testing::FakeGateway gateway([&](const json& message) {
      if (message["type"] == "slice_take") bytes = message["host_bytes"].get<int64_t>();
      return to_json_message(SliceReply{}).dump();
    });
    const auto slices = SliceClient::connect(gateway.address()).value();
    EXPECT_EQ(run(task, slices.get()).error().code, ErrorCode::kCancelled);
    return bytes;
  }

  TaskCompletion done(const Task& task) {
    auto completion = run(task);
    EXPECT_TRUE(completion.ok()) << completion.error().message();
    return completion.ok() ? *completion : TaskCompletion{};
  }

  std::string failure(const Task& task) {
    const auto completion = run(task);
    return completion.ok() ? "ok" : completion.error().message();
  }

  static fs::path output(const TaskCompletion& completion, std::string_view role) {
    for (const TaskOutput& output : completion.outputs) {
      if (output.role == role) return output.path;
    }
    return {};
  }

  static SequenceManifest manifest_of(const TaskCompletion& completion) {
    const auto text = read_file(output(completion, "sequence"));
    EXPECT_TRUE(text.ok());
    auto manifest = parse_sequence({reinterpret_cast<const char*>(text->data()), text->size()});
    EXPECT_TRUE(manifest.ok()) << manifest.error().message();
    return manifest.ok() ? *manifest : SequenceManifest{};
  }

  static Grid grid_at(const fs::path& path) {
    const auto bytes = read_file(path);
    EXPECT_TRUE(bytes.ok());
    auto grid = grid_from_container(*bytes);
    EXPECT_TRUE(grid.ok());
    return grid.ok() ? *std::move(grid) : Grid{};
  }

  Grid frame_grid(size_t k) const {
    return grid_at(dir_.path() / (frames_[k]["grid"].get<std::string>() + ".voxg"));
  }

  // A sequence as the gateway gives it to an export or a render.
  Task sequence_task(JobKind kind, const TaskCompletion& made, const json& options) {
    const fs::path manifest = output(made, "sequence");
    fs::copy_file(manifest, dir_.path() / "sequence.json", fs::copy_options::overwrite_existing);
    Task next = task(kind, "sequence.json", options);
    next.input_is_sequence = true;
    for (const SequenceFrame& frame : manifest_of(made).frames) {
      next.frame_paths.push_back((dir_.path() / (frame.grid + ".voxg")).string());
    }
    return next;
  }

  testing::TemporaryDir dir_;
  Engine engine_;
  std::vector<json> frames_;
  int tasks_ = 0, cancel_after_ = 0;
  int breaks_ = -1;  // a frame whose container is broken once it is stored
};

json small(const std::string& animation) {
  return {{"animation", animation}, {"size", 32}, {"pipeline", "cpu"}};
}

TEST_F(FramesTest, every_frame_of_an_animation_becomes_a_grid_in_one_place) {
  const auto completion = done(task(JobKind::kVoxelize, "worm.md5.zip", small("walk")));
  ASSERT_EQ(frames_.size(), 6u);
  const SequenceManifest manifest = manifest_of(completion);
  ASSERT_EQ(manifest.frames.size(), 6u);
  EXPECT_EQ(manifest.fps, 12.0);
  EXPECT_EQ(std::max({manifest.dims[0], manifest.dims[1], manifest.dims[2]}), 32);
  EXPECT_TRUE(manifest.channels.color);
  for (size_t k = 0; k < 6; ++k) {
    const Grid grid = frame_grid(k);
    EXPECT_EQ(frames_[k]["index"], k);
    EXPECT_EQ(frames_[k]["time_s"], static_cast<double>(k) / 12.0);
    EXPECT_EQ(manifest.frames[k].grid, frames_[k]["grid"].get<std::string>());
    EXPECT_EQ(manifest.frames[k].content_hash, content_hash(grid));
    EXPECT_EQ(manifest.frames[k].voxel_count, grid.voxel_count());
    EXPECT_EQ(grid.spec.dims, glm::ivec3(manifest.dims[0], manifest.dims[1], manifest.dims[2]));
    EXPECT_EQ(grid.spec.origin_world.x, manifest.origin[0]);
    EXPECT_GT(grid.voxel_count(), 100u);
  }
  // The last two frames are the same, and so are their containers: nothing in them tells of time.
  EXPECT_EQ(manifest.frames[4].grid, manifest.frames[5].grid);
  EXPECT_NE(manifest.frames[3].grid, manifest.frames[4].grid);
  const json meta = json::parse(completion.meta_json);
  EXPECT_EQ(meta["frames"], 6);
  EXPECT_EQ(meta["fps"], 12.0);
  EXPECT_EQ(meta["animation"]["name"], "walk");
  EXPECT_EQ(meta["dims"][1], manifest.dims[1]);
}

TEST_F(FramesTest, a_frame_is_the_grid_of_its_time_in_the_same_box) {
  for (const std::string name : {"worm.md5.zip", "spin.glb"}) {
    json options = small("0");
    options["bounds"] = "-6,-6,-6,6,8,8";
    options["channels"] = "color,normal";
    options["frames"] = "1..4";
    (void)done(task(JobKind::kVoxelize, name, options));
    ASSERT_EQ(frames_.size(), 4u) << name;
    std::vector<Grid> frames;
    std::vector<double> times;
    for (size_t k = 0; k < 4; ++k) {
      frames.push_back(frame_grid(k));
      times.push_back(frames_[k]["time_s"]);
    }
    options.erase("frames");
    for (size_t k = 0; k < 4; ++k) {
      options["time"] = times[k];
      const auto still = done(task(JobKind::kVoxelize, name, options));
      const Grid alone = grid_at(output(still, "grid"));
      EXPECT_EQ(alone.spec.dims, frames[k].spec.dims);
      EXPECT_EQ(alone.tiles, frames[k].tiles) << name << " " << k;
    }
  }
}

TEST_F(FramesTest, one_time_is_placed_by_its_own_box) {
  json options = small("wave");
  options["time"] = 0.0;
  const auto still = done(task(JobKind::kVoxelize, "worm.md5.zip", options));
  EXPECT_TRUE(frames_.empty());
  const Grid alone = grid_at(output(still, "grid"));
  EXPECT_EQ(alone.spec.dims.y, 32);  // it stands straight
  options.erase("time");
  (void)done(task(JobKind::kVoxelize, "worm.md5.zip", options));
  // It bends to both sides later.
  EXPECT_LT(alone.spec.dims.z + 4, frame_grid(0).spec.dims.z);
}

TEST_F(FramesTest, stripped_root_motion_stays_in_place) {
  json options = small("walk");
  (void)done(task(JobKind::kVoxelize, "worm.md5.zip", options));
  const double kept = frame_grid(0).spec.dims.x * frame_grid(0).spec.voxel_size.x;
  options["root_motion"] = "strip";
  (void)done(task(JobKind::kVoxelize, "worm.md5.zip", options));
  const double stripped = frame_grid(0).spec.dims.x * frame_grid(0).spec.voxel_size.x;
  EXPECT_NEAR(kept - stripped, 2.0, 0.5);  // it walks two units
}

TEST_F(FramesTest, up_and_transform_hold_for_the_place_of_all_frames) {
  json options = small("wave");
  options["up"] = "z";
  options["transform"] = "2,0,0,0,0,1,0,0,0,0,1,5,0,0,0,1";
  (void)done(task(JobKind::kVoxelize, "worm.md5.zip", options));
  ASSERT_EQ(frames_.size(), 4u);
  for (size_t k = 0; k < frames_.size(); ++k) {
    const Grid grid = frame_grid(k);
    // It lies along -z, six units long, from z = 5 on; and is twice as wide.
    const glm::dvec3 end = grid.spec.world_from_grid(glm::dvec3(grid.spec.dims));
    EXPECT_NEAR(end.z, 5.0, grid.spec.voxel_size.z);
    EXPECT_NEAR(grid.spec.origin_world.z, -1.0, 3 * grid.spec.voxel_size.z);
    EXPECT_NEAR(end.x - grid.spec.origin_world.x, 4.8, 2 * grid.spec.voxel_size.x);
    EXPECT_GT(grid.voxel_count(), 100u);
  }
}

TEST_F(FramesTest, files_that_were_uploaded_one_by_one_are_one_input) {
  const auto zipped = done(task(JobKind::kVoxelize, "worm.md5.zip", small("wave")));
  const SequenceManifest expected = manifest_of(zipped);
  json files = json::array();
  std::vector<std::string> paths;
  for (const auto& [name, bytes] : fixtures::animated_md5_files()) {
    paths.push_back((dir_.path() / name).string());
    files.push_back({{"name", name}, {"asset", id_of(paths.back())}});
  }
  const std::string manifest = json{{"files", files}}.dump();
  write("worm.bundle.json", {manifest.begin(), manifest.end()});
  Task bundled = task(JobKind::kVoxelize, "worm.bundle.json", small("wave"));
  bundled.bundle_paths = paths;
  const auto completion = done(bundled);
  const SequenceManifest made = manifest_of(completion);
  ASSERT_EQ(made.frames.size(), expected.frames.size());
  for (size_t k = 0; k < made.frames.size(); ++k) {
    EXPECT_EQ(made.frames[k].content_hash, expected.frames[k].content_hash);
  }
  EXPECT_TRUE(made.channels.color);
  for (const TaskOutput& output : completion.outputs) {
    EXPECT_TRUE(output.filename.starts_with("worm.")) << output.filename;
  }
}

TEST_F(FramesTest, a_cancel_leaves_finished_frames_and_makes_no_more) {
  cancel_after_ = 2;
  const auto completion = run(task(JobKind::kVoxelize, "worm.md5.zip", small("walk")));
  ASSERT_FALSE(completion.ok());
  EXPECT_EQ(completion.error().code, ErrorCode::kCancelled);
  EXPECT_EQ(frames_.size(), 2u);
}

TEST_F(FramesTest, another_attempt_goes_on_after_the_frames_of_the_one_before) {
  for (const std::string format : {"native", "npz"}) {
    json options = small("walk");
    options["format"] = format;
    const auto whole = done(task(JobKind::kVoxelize, "worm.md5.zip", options));
    const std::string expected = id_of(output(whole, "result"));
    const SequenceManifest manifest = manifest_of(whole);
    for (const size_t stored : {size_t{1}, size_t{4}, size_t{6}}) {
      Task again = task(JobKind::kVoxelize, "worm.md5.zip", options);
      for (size_t k = 0; k < stored; ++k) {
        const SequenceFrame& frame = manifest.frames[k];
        again.done_frames.push_back({frame.grid, (dir_.path() / (frame.grid + ".voxg")).string(),
                                     frame.time_s, frame.voxel_count, frame.content_hash});
      }
      const auto resumed = done(again);
      // If all frames are there, the last one is made again, because its reply is needed.
      EXPECT_EQ(frames_.size(), 6 - std::min<size_t>(stored, 5));
      EXPECT_EQ(frames_.front()["index"], std::min<size_t>(stored, 5));
      EXPECT_EQ(id_of(output(resumed, "result")), expected) << format << stored;
      EXPECT_EQ(sequence_json(manifest_of(resumed)), sequence_json(manifest));
    }
  }
}

TEST_F(FramesTest, frames_of_other_times_or_versions_are_made_again) {
  const auto whole = done(task(JobKind::kVoxelize, "worm.md5.zip", small("walk")));
  const SequenceFrame frame = manifest_of(whole).frames[0];
  const fs::path path = dir_.path() / (frame.grid + ".voxg");
  const auto made_again = [&](const fs::path& from, double time_s) {
    Task again = task(JobKind::kVoxelize, "worm.md5.zip", small("walk"));
    again.done_frames.push_back(
        {frame.grid, from.string(), time_s, frame.voxel_count, frame.content_hash});
    (void)done(again);
    return frames_.size();
  };
  EXPECT_EQ(made_again(path, frame.time_s), 5u);
  EXPECT_EQ(made_again(path, frame.time_s + 0.01), 6u);
  EXPECT_EQ(made_again(dir_.path() / "nothing", frame.time_s), 6u);
  std::string other = "\"algorithm_version\":" + std::to_string(kAlgorithmVersion);
  auto bytes = read_file(path).value();
  const auto at = std::search(bytes.begin(), bytes.end(), other.begin(), other.end());
  ASSERT_NE(at, bytes.end());
  char& digit = reinterpret_cast<char&>(at[static_cast<std::ptrdiff_t>(other.size()) - 1]);
  digit = digit == '0' ? '1' : '0';
  ASSERT_TRUE(write_file(dir_.path() / "old", bytes).ok());
  EXPECT_EQ(made_again(dir_.path() / "old", frame.time_s), 6u);
}

TEST_F(FramesTest, a_cancel_leaves_no_half_sequence) {
  cancel_after_ = 3;
  ASSERT_FALSE(run(task(JobKind::kVoxelize, "worm.md5.zip", small("walk"))).ok());
  EXPECT_FALSE(has_sequence_file());
}

TEST_F(FramesTest, a_broken_container_is_named_by_its_frame_and_leaves_no_half_sequence) {
  json options = small("walk");
  options["channels"] = "normal";
  breaks_ = 2;
  for (const std::string codec : {"fast", "small"}) {
    options["codec"] = codec;
    EXPECT_TRUE(failure(task(JobKind::kVoxelize, "worm.md5.zip", options))
                    .starts_with("frame 2: grid container, stream: "))
        << codec;
    EXPECT_FALSE(has_sequence_file());
  }
  options["codec"] = "fast";
  options["format"] = "npy";
  EXPECT_TRUE(failure(task(JobKind::kVoxelize, "worm.md5.zip", options))
                  .starts_with("frame 2: grid container, stream: "));
}

std::vector<std::vector<SparseTile>> frames_of(const std::vector<uint8_t>& bytes) {
  std::vector<std::vector<SparseTile>> frames;
  const auto reader = SequenceReader::open(bytes);
  EXPECT_TRUE(reader.ok()) << reader.error().message();
  for (size_t k = 0; reader && k < reader->frame_count(); ++k) {
    frames.push_back(reader->decode_frame(k).value());
  }
  return frames;
}

TEST_F(FramesTest, the_sequence_written_beside_is_the_one_of_the_frames_containers) {
  for (const std::string codec : {"fast", "small"}) {
    json options = small("walk");
    options["codec"] = codec;
    options["channels"] = "color,normal";
    const auto made = done(task(JobKind::kVoxelize, "worm.md5.zip", options));
    const auto bytes = read_file(output(made, "result")).value();
    const auto frames = frames_of(bytes);
    ASSERT_EQ(frames.size(), 6U);
    for (size_t k = 0; k < frames.size(); ++k) EXPECT_EQ(frames[k], frame_grid(k).tiles) << k;
    const auto exported =
        done(sequence_task(JobKind::kExport, made, {{"format", "native"}, {"codec", codec}}));
    EXPECT_EQ(frames_of(read_file(output(exported, "result")).value()), frames);
    const json meta = json::parse(made.meta_json);
    EXPECT_GT(meta.at("host_bytes_estimate").get<int64_t>(), 0);
    EXPECT_EQ(SequenceReader::open(bytes)->fps(), 12);
    EXPECT_EQ(json::parse(SequenceReader::open(bytes)->header().meta_json)["frames"], 6);
  }
}

TEST_F(FramesTest, a_sequence_of_a_level_or_a_region_is_made_from_its_grids) {
  json options = small("walk");
  options["level"] = 1;
  const auto half = done(task(JobKind::kVoxelize, "worm.md5.zip", options));
  const auto half_bytes = read_file(output(half, "result")).value();
  const auto half_reader = SequenceReader::open(half_bytes).value();
  EXPECT_EQ(std::ranges::max(half_reader.header().dims), 16);
  EXPECT_EQ(frames_of(half_bytes).size(), 6U);
  options.erase("level");
  options["region"] = "0,0,0,8,8,8";
  const auto part = done(task(JobKind::kVoxelize, "worm.md5.zip", options));
  const auto part_bytes = read_file(output(part, "result")).value();
  EXPECT_EQ(SequenceReader::open(part_bytes)->header().dims, (std::array<int32_t, 3>{8, 8, 8}));
  for (size_t k = 0; k < 6; ++k) {
    size_t inside = 0;
    for (const SparseTile& tile : frame_grid(k).tiles) {
      for_each_voxel(
          tile, [&](int x, int y, int z, size_t) { inside += x < 8 && y < 8 && z < 8 ? 1U : 0U; });
    }
    EXPECT_EQ(SequenceReader::open(part_bytes)->voxel_count(k), inside) << k;
  }
}

TEST_F(FramesTest, animations_and_frames_that_the_asset_lacks_are_refused) {
  const auto of = [&](const std::string& name, json options) {
    options["size"] = 16;
    return failure(task(JobKind::kVoxelize, name, options));
  };
  EXPECT_NE(of("worm.md5.zip", {{"animation", "run"}}).find("\"walk\", \"wave\""),
            std::string::npos);
  EXPECT_NE(of("worm.md5.zip", {{"frames", "2..6"}}).find("there are 6 frames"), std::string::npos);
  fixtures::Bytes still;
  for (const auto& [name, bytes] : fixtures::animated_md5_files()) {
    if (name == "worm.md5mesh") still = bytes;
  }
  write("still.md5mesh", still);
  EXPECT_EQ(of("still.md5mesh", {{"fps", 10}}),
            "animation: this asset has none: expected an asset with animations, got md5mesh");
}

TEST_F(FramesTest, a_sequence_is_exported_whole_or_in_part) {
  const auto made = done(task(JobKind::kVoxelize, "worm.md5.zip", small("walk")));
  for (const std::string format : {"native", "vox", "npz", "npy"}) {
    const auto all =
        done(sequence_task(JobKind::kExport, made, {{"format", format}, {"frames", "1..3"}}));
    EXPECT_GT(fs::file_size(output(all, "result")), 100u) << format;
    EXPECT_EQ(json::parse(all.meta_json)["frames"], 3);
  }
  EXPECT_EQ(failure(sequence_task(JobKind::kExport, made, {{"frames", "6"}})),
            "frames: there are 6 frames: expected 0 to 5, got 6");
}

TEST_F(FramesTest, frames_of_one_grid_are_refused) {
  json options = small("wave");
  options["time"] = 0.0;
  const auto still = done(task(JobKind::kVoxelize, "worm.md5.zip", options));
  fs::copy_file(output(still, "grid"), dir_.path() / "one.voxg");
  Task next = task(JobKind::kExport, "one.voxg", {{"format", "npy"}, {"frames", "0"}});
  next.input_is_grid = true;
  EXPECT_EQ(failure(next), "frames: the input is one grid: expected a sequence, got a grid");
}

int big_endian(const std::vector<uint8_t>& bytes, size_t at) {
  return bytes[at] << 24 | bytes[at + 1] << 16 | bytes[at + 2] << 8 | bytes[at + 3];
}

TEST_F(FramesTest, frames_are_drawn_as_sheet_gif_and_apng_or_one_by_one) {
  const auto made = done(task(JobKind::kVoxelize, "worm.md5.zip", small("walk")));
  const auto drawn = [&](json options) {
    options["width"] = options["height"] = 40;
    const auto completion = done(sequence_task(JobKind::kRender, made, options));
    return read_file(output(completion, "result")).value();
  };
  const auto sheet = drawn({{"image", "sheet"}, {"columns", 4}});
  EXPECT_EQ(big_endian(sheet, 16), 160);
  EXPECT_EQ(big_endian(sheet, 20), 80);
  const auto gif = drawn({{"image", "gif"}});
  EXPECT_EQ(std::string(gif.begin(), gif.begin() + 6), "GIF89a");
  const auto apng = drawn({{"image", "apng"}, {"frames", "2..4"}});
  const std::string text(apng.begin(), apng.end());
  EXPECT_EQ(big_endian(apng, text.find("acTL") + 4), 3);
  const auto one = drawn({{"frame", 3}});
  EXPECT_EQ(big_endian(one, 16), 40);
  EXPECT_NE(one, drawn({{"frame", 0}}));
  EXPECT_EQ(failure(sequence_task(JobKind::kRender, made, {{"frame", 6}})),
            "frame: there are 6 frames: expected 0 to 5, got 6");
}

TEST_F(FramesTest, a_frame_drawn_from_the_asset_is_the_one_of_its_sequence) {
  json options = small("walk");
  const auto made = done(task(JobKind::kVoxelize, "worm.md5.zip", options));
  const json view = {{"frame", 2}, {"width", 48}, {"height", 48}};
  const auto of_sequence = done(sequence_task(JobKind::kRender, made, view));
  options.update(view);
  const auto of_asset = done(task(JobKind::kRender, "worm.md5.zip", options));
  EXPECT_EQ(read_file(output(of_asset, "result")).value(),
            read_file(output(of_sequence, "result")).value());
  EXPECT_TRUE(output(of_asset, "sequence").empty());
  options.erase("frame");
  options["image"] = "gif";
  const auto all = done(task(JobKind::kRender, "worm.md5.zip", options));
  EXPECT_EQ(frames_.size(), 6u);
  EXPECT_EQ(manifest_of(all).frames.size(), 6u);
  EXPECT_EQ(json::parse(all.meta_json)["images"], 6);
}

TEST_F(FramesTest, a_file_that_plays_slower_than_it_should_has_a_warning) {
  json options = {{"size", 8}, {"turntable", 50}, {"width", 8}, {"height", 8}};
  const auto warned = [&](const char* image, int rate) {
    options["image"] = image;
    options["rate"] = rate;
    std::string text;
    for (const Warning& warning : done(task(JobKind::kRender, "worm.md5.zip", options)).warnings) {
      text += warning.code + " " + warning.detail;
    }
    return text;
  };
  EXPECT_EQ(warned("gif", 50), "");
  EXPECT_EQ(warned("gif", 100),
            "slower-play image: 1 seconds instead of 0.5, since its format shows no more images a "
            "second");
  EXPECT_EQ(warned("apng", 100), "");
}

TEST_F(FramesTest, a_grid_is_seen_from_all_sides) {
  json options = {{"size", 24},   {"turntable", 5}, {"image", "sheet"},
                  {"columns", 5}, {"width", 32},    {"height", 32}};
  const auto completion = done(task(JobKind::kRender, "worm.md5.zip", options));
  const auto sheet = read_file(output(completion, "result")).value();
  EXPECT_EQ(big_endian(sheet, 16), 160);
  EXPECT_FALSE(output(completion, "grid").empty());
}

TEST_F(FramesTest, the_first_time_slice_asks_for_the_memory_of_a_sheet) {
  json options = {{"size", 24}, {"image", "sheet"}, {"width", 4096}, {"height", 4096}};
  options["turntable"] = 16;
  const int64_t pixel_bytes = int64_t{4} * 16'384 * 16'384;
  EXPECT_GE(bytes_asked(task(JobKind::kRender, "worm.md5.zip", options)), 2 * pixel_bytes);
  options.erase("turntable");
  options.update(small("walk"));  // 6 frames in 3 columns
  EXPECT_GE(bytes_asked(task(JobKind::kRender, "worm.md5.zip", options)), 2 * pixel_bytes * 6 / 16);
}

TEST_F(FramesTest, inspecting_lists_joints_meshes_and_animations) {
  const auto completion = done(task(JobKind::kInspect, "worm.md5.zip", json::object()));
  const json meta = json::parse(completion.meta_json);
  EXPECT_EQ(meta["joint_count"], 3);
  EXPECT_EQ(meta["joints"][2], (json{{"name", "top"}, {"parent", 1}}));
  EXPECT_EQ(meta["meshes"][0]["influences_max"], 2);
  EXPECT_EQ(meta["animations"][0], (json{{"name", "walk"},
                                         {"frames", 6},
                                         {"frame_rate", 12.0},
                                         {"duration_s", 5.0 / 12},
                                         {"unusable", nullptr}}));
  EXPECT_EQ(meta["animation_count"], 2);
  EXPECT_EQ(meta["materials"][0]["texture"], "skin.png");
  EXPECT_EQ(meta["materials"][0]["found"], true);
}

}  // namespace
}  // namespace voxeld
