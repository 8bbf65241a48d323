// Channels of ids against the oracle, and what is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "server/voxel/attributes/part_ids.h"
#include "server/voxel/voxelize.h"
#include "tests/unit/voxel_cpu/id_checks.h"

namespace voxeld {
namespace {

VoxelizeOptions labelled(LabelKind kind, int size = 48) {
  VoxelizeOptions options;
  options.placement.size = size;
  options.channels = ChannelSet{.label = true};
  options.labels = kind;
  return options;
}

Grid voxelized(const Scene& scene, const VoxelizeOptions& options) {
  Voxelizer voxelizer;
  auto grid = voxelizer.voxelize(scene, options, {}, nullptr);
  EXPECT_TRUE(grid.ok()) << grid.error().message();
  return grid.ok() ? std::move(grid).value() : Grid();
}

std::set<int> used_labels(const Grid& grid) {
  std::set<int> used;
  for (const SparseTile& tile : grid.tiles) used.insert(tile.label.begin(), tile.label.end());
  return used;
}

struct Kind {
  LabelKind kind;
  const char* name;
  int (*id)(const MeshPart&);
  size_t count;  // of ids in the scene
};

const Kind kKinds[] = {
    {LabelKind::kMesh, "mesh", [](const MeshPart& part) { return int(part.mesh) + 1; }, 6},
    {LabelKind::kNode, "node", [](const MeshPart& part) { return int(part.node) + 1; }, 2},
    {LabelKind::kMaterial, "material", [](const MeshPart& part) { return part.material + 1; }, 4},
    {LabelKind::kGroup, "group", [](const MeshPart& part) { return int(part.group) + 1; }, 36}};

TEST(Labels, are_the_ids_with_the_largest_surface_by_the_oracle) {
  const Scene scene = test::gored_balls();
  for (const Kind& kind : kKinds) {
    std::vector<int> ids;
    for (const MeshPart& part : scene.parts) ids.push_back(kind.id(part));
    const Grid grid = voxelized(scene, labelled(kind.kind));
    EXPECT_TRUE(grid.channels.label);
    EXPECT_FALSE(grid.channels.material);
    EXPECT_EQ(used_labels(grid).size(), kind.count) << kind.name;
    test::expect_largest_ids(grid, Channel::kLabel, scene, ids, kind.name);
  }
}

TEST(Labels, materials_are_those_of_channel_material) {
  const Scene scene = test::gored_balls();
  VoxelizeOptions options = labelled(LabelKind::kMaterial);
  options.channels->material = true;
  const Grid grid = voxelized(scene, options);
  ASSERT_FALSE(grid.tiles.empty());
  for (const SparseTile& tile : grid.tiles) {
    EXPECT_EQ(tile.label.size(), tile.voxel_count());
    EXPECT_EQ(tile.label, tile.material);
  }
}

TEST(Labels, do_not_depend_on_the_order_of_parts_nor_on_other_channels) {
  Scene scene = test::gored_balls();
  VoxelizeOptions options = labelled(LabelKind::kGroup, 300);
  const Grid grid = voxelized(scene, options);
  ASSERT_GT(grid.tiles.size(), 1u);
  std::ranges::reverse(scene.parts);
  options.channels->normal = options.channels->coverage = true;
  const Grid other = voxelized(scene, options);
  ASSERT_EQ(grid.tiles.size(), other.tiles.size());
  for (size_t i = 0; i < grid.tiles.size(); ++i) {
    EXPECT_EQ(grid.tiles[i].label, other.tiles[i].label);
  }
}

TEST(Labels, labels_of_a_solid_are_0_inside_or_those_of_the_nearest_surface) {
  Scene scene = test::gored_balls();
  VoxelizeOptions options = labelled(LabelKind::kMesh);
  options.fill = Fill::kSolid;
  options.sign = Sign::kNonzero;
  EXPECT_EQ(used_labels(voxelized(scene, options)), (std::set<int>{0, 1, 2, 3, 4, 5, 6}));
  options.interior = Interior::kNearest;
  EXPECT_EQ(used_labels(voxelized(scene, options)), (std::set<int>{1, 2, 3, 4, 5, 6}));
}

// A row of `count` squares, each of its own group.
Scene row_of_groups(int count) {
  Scene scene;
  scene.groups.clear();
  for (int i = 0; i < count; ++i) {
    MeshPart& part = scene.parts.emplace_back();
    part.group = static_cast<uint32_t>(i);
    scene.groups.push_back("g" + std::to_string(i));
    const double x = i % 256 / 4.0, y = i / 256 / 4.0;
    part.positions = {{x, y, 0.5}, {x + 0.25, y, 0.5}, {x, y + 0.25, 0.5}};
    part.indices = {0, 1, 2};
  }
  return scene;
}

TEST(Labels, number_as_many_groups_as_16_bits_hold) {
  const Scene scene = row_of_groups(65'535);
  VoxelizeOptions options = labelled(LabelKind::kGroup);
  options.placement.size.reset();
  options.placement.voxel_size = {0.25, 0.25, 0.25};
  const auto used = used_labels(voxelized(scene, options));
  EXPECT_EQ(*used.rbegin(), 65'535);
  EXPECT_GT(used.size(), 65'000u);
  // All of them in few voxels, where each is looked at for all.
  options.placement.voxel_size = {16, 16, 16};
  const auto few = used_labels(voxelized(scene, options));
  EXPECT_LE(few.size(), 16u);
  EXPECT_EQ(*few.begin(), 1) << "the first of equal ones";
}

TEST(Labels, more_than_16_bits_or_parts_of_several_groups_are_refused) {
  const auto refusal = [](const Scene& scene, LabelKind kind) {
    Voxelizer voxelizer;
    const auto refused = voxelizer.voxelize(scene, labelled(kind), {}, nullptr);
    EXPECT_EQ(refused.ok() ? ErrorCode::kInternal : refused.error().code,
              refused.ok() ? ErrorCode::kInternal : ErrorCode::kInvalidOption);
    return refused.ok() ? "ok" : refused.error().message();
  };
  Scene scene = row_of_groups(65'536);
  EXPECT_EQ(refusal(scene, LabelKind::kGroup),
            "labels: too many groups: expected at most 65535, got 65536");
  EXPECT_EQ(refusal(scene, LabelKind::kMesh), "ok");
  scene = row_of_groups(100);
  scene.parts_merged = true;
  EXPECT_EQ(refusal(scene, LabelKind::kGroup),
            "labels: too many groups: expected at most 65535, got more than 99 parts of the file");
  EXPECT_EQ(refusal(scene, LabelKind::kNode),
            "labels: too many nodes: expected at most 65535, got more than 99 parts of the file");
  EXPECT_EQ(refusal(scene, LabelKind::kMaterial), "ok") << "materials are never merged";
}

TEST(Labels, names_are_those_of_the_file_in_the_order_of_ids) {
  const Scene scene = test::gored_balls();
  EXPECT_EQ(id_names(scene, LabelKind::kNode), (std::vector<std::string>{"near", "far"}));
  EXPECT_EQ(id_names(scene, LabelKind::kMesh).at(5), "ball 5");
  EXPECT_EQ(id_names(scene, LabelKind::kGroup).size(), 36u);
  EXPECT_EQ(id_names(scene, LabelKind::kMaterial).size(), 3u);
}

}  // namespace
}  // namespace voxeld
