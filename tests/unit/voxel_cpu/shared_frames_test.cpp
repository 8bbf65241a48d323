// Frames of one scene: what they share must not show in any byte.
#include "server/voxel/frames/shared_frames.h"

#include <gtest/gtest.h>

#include <random>

#include "server/voxel/voxelize.h"

namespace voxeld {
namespace {

// A textured sheet of 16 x 16 quads.
Scene sheet() {
  Scene scene;
  MeshPart part;
  for (int y = 0; y <= 16; ++y) {
    for (int x = 0; x <= 16; ++x) {
      part.positions.emplace_back(x, y, 0.0);
      part.uvs.emplace_back(static_cast<float>(x) / 16.0f, static_cast<float>(y) / 16.0f);
    }
  }
  for (uint32_t y = 0; y < 16; ++y) {
    for (uint32_t x = 0; x < 16; ++x) {
      const uint32_t a = y * 17 + x;
      for (const uint32_t corner : {a, a + 1, a + 18, a, a + 18, a + 17}) {
        part.indices.push_back(corner);
      }
    }
  }
  std::mt19937 random(11);
  Image image{"noise", 256, 256, {}};
  for (int i = 0; i < 4 * 256 * 256; ++i) image.rgba.push_back(static_cast<uint8_t>(random()));
  scene.images.push_back(image);
  Material material;
  material.image = 0;
  scene.materials.push_back(material);
  part.material = 0;
  scene.parts.push_back(part);
  return scene;
}

// Bent and scaled: texels become larger and smaller than voxels from frame to frame.
void bend(Scene& scene, const Scene& flat, int frame) {
  const double scale = frame % 3 == 0 ? 1.0 : frame % 3 == 1 ? 0.1 : 0.35;
  for (size_t v = 0; v < flat.parts[0].positions.size(); ++v) {
    const glm::dvec3 p = flat.parts[0].positions[v] * scale;
    scene.parts[0].positions[v] = {p.x, p.y, 0.05 * frame * p.x * p.y / 16.0};
  }
}

VoxelizeOptions in_box() {
  VoxelizeOptions options;
  options.placement.bounds = {{0.0, 0.0, 0.0, 16.0, 16.0, 8.0}};
  options.placement.size = 96;
  options.channels = ChannelSet{.color = true, .normal = true};
  return options;
}

Grid frame_of(Voxelizer& voxelizer, const Scene& scene, const VoxelizeOptions& options,
              SharedFrames* frames) {
  Grid grid;
  GridSink sink(grid);
  VoxelizeStats stats;
  const Status done = voxelizer.voxelize(scene, options, frames, sink, {}, &stats);
  EXPECT_TRUE(done.ok()) << done.error().message();
  return grid;
}

TEST(SharedFrames, each_frame_has_the_bytes_of_a_request_of_its_own) {
  const Scene flat = sheet();
  Scene scene = flat;
  const VoxelizeOptions options = in_box();
  const auto spec = place_grid(options.placement, glm::dvec3(0.0), glm::dvec3(1.0));
  ASSERT_TRUE(spec.ok());
  for (const ColorMode mode : {ColorMode::kAverage, ColorMode::kNearest, ColorMode::kDominant}) {
    VoxelizeOptions asked = options;
    asked.color = mode;
    Voxelizer voxelizer, other;
    SharedFrames frames(*spec);
    for (int frame = 0; frame < 7; ++frame) {
      bend(scene, flat, frame);
      const Grid shared = frame_of(voxelizer, scene, asked, &frames);
      const Grid alone = frame_of(other, scene, asked, nullptr);
      ASSERT_FALSE(alone.tiles.empty());
      EXPECT_EQ(shared.tiles, alone.tiles) << frame;
      EXPECT_EQ(shared.spec.dims, alone.spec.dims);
    }
    voxelizer.end_frames();
    bend(scene, flat, 1);
    EXPECT_EQ(frame_of(voxelizer, scene, asked, nullptr).tiles,
              frame_of(other, scene, asked, nullptr).tiles);
  }
}

TEST(SharedFrames, a_frame_is_placed_as_all_are_and_not_as_its_mesh_is) {
  Scene scene = sheet();
  VoxelizeOptions options = in_box();
  options.placement = {};
  options.placement.size = 32;
  GridSpec spec;
  spec.dims = {40, 50, 60};
  spec.origin_world = {-1.0, -2.0, -3.0};
  spec.voxel_size = glm::dvec3(0.5);
  SharedFrames frames(spec);
  Voxelizer voxelizer;
  const Grid grid = frame_of(voxelizer, scene, options, &frames);
  EXPECT_EQ(grid.spec.dims, spec.dims);
  EXPECT_EQ(grid.spec.origin_world, spec.origin_world);
  EXPECT_GT(grid.voxel_count(), 0u);
}

// Out of the box and back: triangles in pieces are not those of the next frame.
TEST(SharedFrames, frames_that_leave_the_box_are_those_of_requests_of_their_own) {
  const Scene flat = sheet();
  const VoxelizeOptions options = in_box();
  const auto spec = place_grid(options.placement, glm::dvec3(0.0), glm::dvec3(1.0));
  ASSERT_TRUE(spec.ok());
  Voxelizer voxelizer, other;
  SharedFrames frames(*spec);
  for (const double shift : {0.0, 0.0, 5.0, 5.0, 100.0, 3.0, 0.0, 0.0}) {
    Scene scene = flat;
    for (glm::dvec3& p : scene.parts[0].positions) p.x += shift;
    const Grid shared = frame_of(voxelizer, scene, options, &frames);
    EXPECT_EQ(shared.tiles, frame_of(other, scene, options, nullptr).tiles) << shift;
    EXPECT_EQ(shared.tiles.empty(), shift == 100.0);
  }
  voxelizer.end_frames();
}

// Without a device that does it, the CPU moves vertices that have not been moved.
TEST(SharedFrames, a_pose_moves_the_vertices_unless_they_are_there) {
  const Scene flat = sheet();
  const VoxelizeOptions options = in_box();
  const auto spec = place_grid(options.placement, glm::dvec3(0.0), glm::dvec3(1.0));
  ASSERT_TRUE(spec.ok());
  std::vector<SkinPart> parts(1);
  for (const glm::dvec3& p : flat.parts[0].positions) {
    parts[0].points.push_back(p);
    parts[0].normals.emplace_back(0, 0, 1);
    parts[0].influences.push_back({0, 1.0});
    parts[0].end_vertex();
  }
  const SkinTable table = join_skin_parts(std::move(parts), false);
  Voxelizer voxelizer, other;
  SharedFrames frames(*spec);
  Scene scene = flat;
  for (const bool is_moved : {false, true, false}) {
    Pose pose;
    pose.world_from_bound = {glm::dmat4(1.0)};
    pose.world_from_bound[0][3].z = 3.25;
    scene = flat;
    frames.set_pose({&table, &pose, &scene, is_moved});
    const Grid grid = frame_of(voxelizer, scene, options, &frames);
    EXPECT_FALSE(frames.device_moves());
    Scene expected = flat;
    for (glm::dvec3& p : expected.parts[0].positions) p.z += is_moved ? 0.0 : 3.25;
    EXPECT_EQ(grid.tiles, frame_of(other, expected, options, nullptr).tiles);
    EXPECT_EQ(scene.parts[0].positions, expected.parts[0].positions);
  }
  voxelizer.end_frames();
}

TEST(SharedFrames, levels_only_grow_and_name_new_textures_when_they_do) {
  SharedFrames frames{GridSpec{}};
  SharedFrames others{GridSpec{}};
  EXPECT_NE(frames.textures_key(), others.textures_key());
  std::vector<ImageLevels> levels = {{2, 3}, {}};
  frames.unite_levels(levels);
  const uint64_t first = frames.textures_key();
  levels = {{3, 3}, {}};
  frames.unite_levels(levels);
  EXPECT_EQ(levels[0].first, 2);
  EXPECT_FALSE(levels[1].used());
  EXPECT_EQ(frames.textures_key(), first);
  levels = {{1, 2}, {0, 0}};
  frames.unite_levels(levels);
  EXPECT_EQ(levels[0].first, 1);
  EXPECT_EQ(levels[0].last, 3);
  EXPECT_NE(frames.textures_key(), first);
}

}  // namespace
}  // namespace voxeld
