// Vertices of animations moved by the device: the bits are those of the CPU, frames are equal
// whoever moved them, and what does not move stays on the device.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "server/gpu/shader_source.h"
#include "server/scene/core/animated_scene.h"
#include "server/voxel/gl/skin/skin_check.h"
#include "server/voxel/gl/skin/skin_pass.h"
#include "tests/gpu/voxel/pipelines.h"
#include "tests/gpu/voxel/worm.h"

namespace voxeld::pipelines {
namespace {

struct Moved {
  std::vector<glm::ivec3> q;
  std::vector<glm::dvec3> positions;
  bool stands_in_cells = false;
};

Moved moved_by_device(SkinPass& pass, const SkinFrame& frame) {
  const size_t count = frame.table.vertex_count();
  Moved moved;
  auto vertices = gpu::Buffer::create(gpu::test_context(), 12 * count, "vertices");
  EXPECT_TRUE(vertices.ok());
  EXPECT_TRUE(pass.begin_frames(frame.table, frame.key).ok());
  gpu::PassTimer timer(gpu::test_context());
  const auto done = pass.run(frame, *vertices, timer);
  EXPECT_TRUE(done.ok()) << done.error().message();
  moved.stands_in_cells = done.ok() && *done;
  moved.q.resize(count);
  vertices->read(0, std::span(moved.q));
  moved.positions.resize(count);
  if (frame.wants_positions) pass.read_positions(0, moved.positions);
  return moved;
}

Scene moved_by_cpu(const SkinTable& table, const Scene& bind, const Pose& pose) {
  Scene scene = bind;
  FrameVertices vertices;
  const Status done = skin_vertices(table, bind, pose, vertices);
  EXPECT_TRUE(done.ok()) << done.error().message();
  if (done.ok()) swap_vertices(vertices, scene);
  return scene;
}

// The grid of all frames: no vertex leaves it.
GridSpec grid_of(int longest) {
  GridSpec spec;
  spec.dims = {longest, longest, longest};
  spec.origin_world = {-12.1, -12.2, -12.3};
  spec.voxel_size = glm::dvec3(24.7 / longest);
  return spec;
}

void expect_same_bits(SkinPass& pass, const SkinTable& table, const Scene& bind, const Pose& pose,
                      const GridSpec& spec, const glm::dmat4& world_from_file, bool expects_cells) {
  const Scene scene = moved_by_cpu(table, bind, pose);
  const auto expected = snap_scene(scene, world_from_file, spec);
  ASSERT_TRUE(expected.ok());
  const Moved found = moved_by_device(pass, {table, pose, spec, world_from_file, true, 0});
  EXPECT_EQ(found.stands_in_cells, expects_cells);
  EXPECT_TRUE(std::ranges::equal(found.q, expected->vertices));
  std::vector<glm::dvec3> positions;
  for (const MeshPart& part : scene.parts) {
    positions.insert(positions.end(), part.positions.begin(), part.positions.end());
  }
  EXPECT_TRUE(found.positions == positions);
}

TEST(Skin, this_device_has_the_floats_of_the_cpu) {
  EXPECT_TRUE(gpu::test_context().info().has_float64);
  SkinPass pass(gpu::test_context(), shared_shaders());
  const auto exact = pass.is_exact();
  ASSERT_TRUE(exact.ok());
  EXPECT_TRUE(*exact);
  for (const SkinSample& sample : skin_samples()) {
    expect_same_bits(pass, sample.table, sample.scene, sample.pose, sample.spec,
                     sample.world_from_file, false);
  }
}

TEST(Skin, vertices_of_both_kinds_are_those_of_the_cpu_bit_for_bit) {
  SkinPass pass(gpu::test_context(), shared_shaders());
  const glm::dmat4 turned(0.96, 0.02, 0.1, 0, 0, 0.1, -0.97, 0, 0.05, 0.93, 0.12, 0, 0.1, 0.2, -0.3,
                          1);
  for (const bool is_md5 : {true, false}) {
    const Worm worm(is_md5, 400);  // 8400 vertices
    for (int frame = 0; frame < 4; ++frame) {
      expect_same_bits(pass, worm.table, worm.scene, worm.pose(frame), grid_of(1999),
                       glm::dmat4(1.0), true);
      expect_same_bits(pass, worm.table, worm.scene, worm.pose(frame), grid_of(2048), turned, true);
    }
  }
}

TEST(Skin, vertices_outside_of_the_grid_and_at_no_finite_place_are_reported) {
  SkinPass pass(gpu::test_context(), shared_shaders());
  const Worm worm(false);
  GridSpec spec = grid_of(256);
  const Pose rest = worm.pose(0);
  EXPECT_TRUE(moved_by_device(pass, {worm.table, rest, spec}).stands_in_cells);
  for (const double odd : {1e3, 1e31, HUGE_VAL, -HUGE_VAL, std::nan("")}) {
    Pose pose = worm.pose(0);
    pose.world_from_bound[4][3].x = odd;
    EXPECT_FALSE(moved_by_device(pass, {worm.table, pose, spec}).stands_in_cells) << odd;
  }
  spec.dims.y = 128;  // the tube leaves it
  EXPECT_FALSE(moved_by_device(pass, {worm.table, rest, spec}).stands_in_cells);
}

// The shaders with one text replaced.
class ChangedShaders {
 public:
  ChangedShaders(const std::string& name, const std::string& from, const std::string& to) {
    std::string pattern =
        (std::filesystem::temp_directory_path() / "voxeld-shaders-XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
    for (const char* file : {"skin.comp", "lib/divide.glsl", "shared/skin.h", "shared/types.h"}) {
      std::string text = gpu::read_embedded_shader(file).value();
      if (file == name) {
        const size_t at = text.find(from);
        EXPECT_NE(at, std::string::npos) << from;
        text.replace(at, from.size(), to);
      }
      std::filesystem::create_directories((folder_ / file).parent_path());
      std::ofstream(folder_ / file) << text;
    }
  }
  ~ChangedShaders() { std::filesystem::remove_all(folder_); }
  std::string folder() const { return folder_.string(); }

 private:
  std::filesystem::path folder_;
};

TEST(Skin, arithmetic_that_is_off_by_a_bit_is_found_out) {
  struct Case {
    const char *file, *from, *to;
  };
  for (const Case& one :
       {// A quotient that is not rounded correctly.
        Case{"lib/divide.glsl", "return abs(other_rest) < abs(rest) ? other : quotient;",
             "return a * reciprocal;"},
        // Another order of sums.
        Case{"skin.comp", "sum = sum + m.z * p.z;\n  sum = sum + m.w;",
             "sum = sum + (m.z * p.z + m.w);"},
        // Single precision.
        Case{"skin.comp", "sum = sum + m.w;", "sum = sum + dvec3(vec3(m.w));"},
        // Towards zero.
        Case{"skin.comp", "int in_box = clamp(q,", "int in_box = clamp(int(at),"},
        // A driver that compiles none of it.
        Case{"skin.comp", "dvec3 position = skinned(vertex);", "dvec3 position = none;"}}) {
    const ChangedShaders changed(one.file, one.from, one.to);
    gpu::ShaderLibrary shaders(gpu::test_context(), changed.folder());
    SkinPass pass(gpu::test_context(), shaders);
    const auto exact = pass.is_exact();
    ASSERT_TRUE(exact.ok());
    EXPECT_FALSE(*exact) << one.to;
  }
}

TEST(Skin, tables_that_buffers_or_loops_cannot_hold_are_left_to_the_cpu) {
  const Worm worm(true);
  EXPECT_TRUE(SkinPass::fits(worm.table, 1 << 20));
  EXPECT_FALSE(SkinPass::fits(worm.table, 1 << 10));
  SkinTable hub;
  hub.first_influence = {0, SKIN_LOOP_MAX};
  hub.influences.resize(SKIN_LOOP_MAX);
  hub.points.resize(1);
  EXPECT_TRUE(SkinPass::fits(hub, 1 << 20));
  hub.first_morph = {0, 1};
  hub.morphs.resize(1);
  EXPECT_FALSE(SkinPass::fits(hub, 1 << 20));
}

// Frames of a worm by one voxelizer, as a worker asks for them.
class Frames {
 public:
  Frames(const Worm& worm, VoxelizeOptions options, const GridSpec& spec, GlTuning tuning)
      : worm_(worm),
        options_(std::move(options)),
        voxelizer_(std::make_unique<GlPipeline>(gpu::test_context(), shared_shaders(), tuning)),
        shared_(spec),
        scene_(worm.scene) {
    options_.pipeline = PipelineChoice::kCompute;
  }
  ~Frames() { voxelizer_.end_frames(); }

  // The frame's grid; its vertices are moved before only where that is asked for.
  Grid make(const Pose& pose) {
    const bool is_moved = !shared_.device_moves();
    if (is_moved) scene_ = moved_by_cpu(worm_.table, worm_.scene, pose);
    shared_.set_pose({&worm_.table, &pose, &scene_, is_moved});
    stats_ = {};
    Grid grid;
    GridSink sink(grid);
    error_ = "";
    const Status done = voxelizer_.voxelize(scene_, options_, &shared_, sink, {}, &stats_);
    if (!done.ok()) error_ = done.error().message();
    return grid;
  }

  // Whether a device moved the vertices of the last frame.
  bool was_skinned() const {
    return std::ranges::any_of(stats_.passes, [](const auto& p) { return p.first == "skin"; });
  }
  const VoxelizeStats& stats() const { return stats_; }
  const std::string& error() const { return error_; }
  const SharedFrames& shared() const { return shared_; }

 private:
  const Worm& worm_;
  VoxelizeOptions options_;
  Voxelizer voxelizer_;
  SharedFrames shared_;
  Scene scene_;
  VoxelizeStats stats_;
  std::string error_;
};

// A frame of its own, by pipeline cpu.
Grid alone(const Worm& worm, VoxelizeOptions options, const GridSpec& spec, const Pose& pose) {
  const Scene scene = moved_by_cpu(worm.table, worm.scene, pose);
  options.pipeline = PipelineChoice::kCpu;
  SharedFrames shared(spec);
  Grid grid;
  GridSink sink(grid);
  Voxelizer voxelizer;
  EXPECT_TRUE(voxelizer.voxelize(scene, options, &shared, sink, {}, nullptr).ok());
  return grid;
}

VoxelizeOptions geometry() {
  VoxelizeOptions options;
  options.color = ColorMode::kNone;
  return options;
}

VoxelizeOptions colors(ColorMode mode = ColorMode::kAverage) {
  VoxelizeOptions options;
  options.color = mode;
  return options;
}

void expect_frames_of_the_device(const Worm& worm, const VoxelizeOptions& options, int size) {
  const GridSpec spec = grid_of(size);
  Frames frames(worm, options, spec, {.batches = true});
  for (int frame = 0; frame < 4; ++frame) {
    const Pose pose = worm.pose(frame);
    const Grid grid = frames.make(pose);
    EXPECT_EQ(frames.error(), "");
    EXPECT_EQ(frames.was_skinned(), frame > 0);
    EXPECT_EQ(frames.stats().pipeline, Pipeline::kCompute);
    const Grid expected = alone(worm, options, spec, pose);
    EXPECT_GT(expected.voxel_count(), 100u);
    EXPECT_TRUE(grid.tiles == expected.tiles) << frame;
  }
}

TEST(Skin, frames_of_the_device_are_those_of_the_cpu) {
  for (const bool is_md5 : {true, false}) {
    const Worm worm(is_md5);
    expect_frames_of_the_device(worm, geometry(), 96);
    expect_frames_of_the_device(worm, colors(), 96);
  }
}

TEST(Skin, frames_of_the_device_are_those_of_the_cpu_across_tiles) {
  const Worm worm(true);
  expect_frames_of_the_device(worm, geometry(), 600);
  expect_frames_of_the_device(worm, colors(), 300);
}

TEST(Skin, colours_that_the_cpu_finishes_see_the_vertices_that_the_device_moved) {
  const Worm worm(false);
  expect_frames_of_the_device(worm, colors(ColorMode::kNearest), 64);
  expect_frames_of_the_device(worm, colors(ColorMode::kDominant), 64);
}

TEST(Skin, the_transform_of_a_request_is_the_devices_too) {
  const Worm worm(true);
  VoxelizeOptions options = geometry();
  options.placement.up = UpAxis::kZ;
  options.placement.transform = {0.9, 0.1, 0, 0.5, -0.1, 0.9, 0, 0, 0, 0, 1.05, 0.25, 0, 0, 0, 1};
  expect_frames_of_the_device(worm, options, 128);
}

TEST(Skin, normals_fills_and_other_pipelines_are_left_to_the_cpu) {
  const Worm worm(true);
  VoxelizeOptions normals = colors(), shaded = colors(ColorMode::kShaded), solid = geometry();
  normals.channels = ChannelSet{.color = true, .normal = true};
  solid.fill = Fill::kSolid;
  const GridSpec spec = grid_of(64);
  const auto expect_cpu = [&](const VoxelizeOptions& options, const GlTuning& tuning) {
    Frames frames(worm, options, spec, tuning);
    for (int frame = 0; frame < 3; ++frame) {
      const Pose pose = worm.pose(frame);
      const Grid grid = frames.make(pose);
      EXPECT_EQ(frames.error(), "");
      EXPECT_FALSE(frames.was_skinned());
      EXPECT_TRUE(grid.tiles == alone(worm, options, spec, pose).tiles);
    }
  };
  for (const VoxelizeOptions& options : {normals, shaded, solid}) {
    expect_cpu(options, {.batches = true});
  }
  // Software drivers, no floats, and buffers that hold no table.
  expect_cpu(geometry(), {.batches = false});
  expect_cpu(geometry(), {.batches = true, .float64 = false});
  expect_cpu(geometry(), {.batches = true, .storage_bytes = 1 << 14});
}

TEST(Skin, a_frame_that_leaves_the_grid_is_the_cpus_and_those_after_it_the_devices_again) {
  const Worm worm(false);
  const GridSpec spec = grid_of(200);
  for (const VoxelizeOptions& options : {geometry(), colors()}) {
    Frames frames(worm, options, spec, {.batches = true});
    const std::vector<bool> leaves = {false, false, true, true, false, false};
    std::vector<bool> skinned;
    for (size_t frame = 0; frame < leaves.size(); ++frame) {
      Pose pose = worm.pose(static_cast<int>(frame));
      if (leaves[frame]) pose.world_from_bound[3][3].x += 30.0;
      const Grid grid = frames.make(pose);
      EXPECT_EQ(frames.error(), "");
      EXPECT_TRUE(grid.tiles == alone(worm, options, spec, pose).tiles) << frame;
      // The first that leaves it is tried on the device; the others are expected to be like the
      // one before them.
      skinned.push_back(frames.was_skinned());
      EXPECT_EQ(frames.shared().device_moves(), !leaves[frame]) << frame;
    }
    EXPECT_EQ(skinned, (std::vector<bool>{false, true, true, false, false, true}));
  }
}

TEST(Skin, a_vertex_at_no_finite_place_is_the_error_of_the_cpu) {
  const Worm worm(true);
  Frames frames(worm, geometry(), grid_of(64), {.batches = true});
  frames.make(worm.pose(0));
  ASSERT_TRUE(frames.shared().device_moves());
  Pose pose = worm.pose(1);
  pose.world_from_bound[2][3].y = HUGE_VAL;
  frames.make(pose);
  FrameVertices vertices;
  const Status expected = skin_vertices(worm.table, worm.scene, pose, vertices);
  ASSERT_FALSE(expected.ok());
  EXPECT_EQ(frames.error(), expected.error().message());
}

TEST(Skin, topology_and_rig_are_uploaded_once) {
  const Worm worm(true, 200);
  const auto triangle_bytes = static_cast<int64_t>(worm.scene.triangle_count() * 16);
  const auto pair_bytes = static_cast<int64_t>(worm.scene.triangle_count() * 4);
  const auto vertex_bytes = static_cast<int64_t>(worm.scene.vertex_count() * 12);
  const auto table_bytes =
      static_cast<int64_t>(worm.table.points.size() * 24 + worm.table.influences.size() * 16);
  // A matrix is 12 doubles; the head of the frame and parameters are some more.
  const auto pose_bytes = static_cast<int64_t>(worm.pose(0).world_from_bound.size() * 96);
  Frames frames(worm, geometry(), grid_of(128), {.batches = true});
  std::vector<int64_t> uploaded;
  for (int frame = 0; frame < 4; ++frame) {
    const Pose pose = worm.pose(frame);
    frames.make(pose);
    uploaded.push_back(frames.stats().mesh_bytes_uploaded);
  }
  EXPECT_GT(uploaded[0], triangle_bytes + pair_bytes + vertex_bytes);
  EXPECT_GE(uploaded[1], table_bytes + pose_bytes);
  EXPECT_LT(uploaded[1], triangle_bytes + table_bytes);
  EXPECT_LT(uploaded[2], pose_bytes + 256);
  EXPECT_EQ(uploaded[3], uploaded[2]);
  // Nothing but the pose, of a mesh of 8000 triangles.
  EXPECT_LT(100 * uploaded[2], triangle_bytes);

  // The CPU's frames leave the triangles where they are, too.
  Frames others(worm, geometry(), grid_of(128), {.batches = true, .float64 = false});
  for (int frame = 0; frame < 2; ++frame) {
    const Pose pose = worm.pose(frame);
    others.make(pose);
    EXPECT_EQ(others.stats().mesh_bytes_uploaded, frame == 0 ? uploaded[0] : vertex_bytes);
  }
}

// Two sequences on one device: neither is given what was uploaded for the other.
TEST(Skin, sequences_do_not_share_uploads) {
  const Worm one(true), other(true, 31);
  Voxelizer voxelizer(std::make_unique<GlPipeline>(gpu::test_context(), shared_shaders(),
                                                   GlTuning{.batches = true}));
  VoxelizeOptions options = geometry();
  options.pipeline = PipelineChoice::kCompute;
  const GridSpec spec = grid_of(80);
  SharedFrames shared_one(spec), shared_other(spec);
  Scene scene_one = one.scene, scene_other = other.scene;
  for (int frame = 0; frame < 3; ++frame) {
    for (const bool is_one : {true, false}) {
      const Worm& worm = is_one ? one : other;
      SharedFrames& shared = is_one ? shared_one : shared_other;
      Scene& scene = is_one ? scene_one : scene_other;
      const Pose pose = worm.pose(frame);
      shared.set_pose({&worm.table, &pose, &scene, false});
      Grid grid;
      GridSink sink(grid);
      ASSERT_TRUE(voxelizer.voxelize(scene, options, &shared, sink, {}, nullptr).ok());
      EXPECT_TRUE(grid.tiles == alone(worm, options, spec, pose).tiles) << frame << is_one;
    }
  }
}

}  // namespace
}  // namespace voxeld::pipelines
