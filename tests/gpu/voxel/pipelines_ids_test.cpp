// Channels of ids by each pipeline: few, which a device sums, and many, which the CPU finishes.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/gpu/voxel/pipelines.h"
#include "tests/unit/voxel_cpu/id_checks.h"

namespace voxeld::pipelines {
namespace {

VoxelizeOptions labelled(LabelKind kind, int size) {
  VoxelizeOptions options;
  options.placement.size = size;
  options.channels = ChannelSet{.label = true};
  options.labels = kind;
  return options;
}

TEST(Ids, each_kind_is_the_same_by_each_pipeline_and_the_largest_by_the_oracle) {
  const Scene scene = test::gored_balls();
  for (const LabelKind kind : {LabelKind::kMesh, LabelKind::kMaterial, LabelKind::kGroup}) {
    const std::string what = "kind " + std::to_string(static_cast<int>(kind));
    std::vector<int> ids;
    for (const MeshPart& part : scene.parts) {
      ids.push_back(kind == LabelKind::kMesh    ? int(part.mesh) + 1
                    : kind == LabelKind::kGroup ? int(part.group) + 1
                                                : part.material + 1);
    }
    const Grid grid = voxelize_all(scene, labelled(kind, 48), what);
    test::expect_largest_ids(grid, Channel::kLabel, scene, ids, what);
  }
}

TEST(Ids, beside_all_other_channels_and_over_tiles_are_the_same_by_each_pipeline) {
  Scene scene = test::gored_balls();
  for (MeshPart& part : scene.parts) {
    part.colors.assign(part.positions.size(),
                       glm::vec4(float(part.group % 7) / 6.0f, 0.5f, 0.2f, 1.0f));
  }
  VoxelizeOptions options = labelled(LabelKind::kGroup, 280);
  options.channels->color = options.channels->normal = options.channels->material = true;
  options.channels->coverage = true;
  const Grid grid = voxelize_all(scene, options);
  ASSERT_GT(grid.tiles.size(), 1u);
  // 36 materials: also the colours are finished by the CPU.
  scene.materials.resize(36);
  for (MeshPart& part : scene.parts) part.material = static_cast<int>(part.group);
  options.color = ColorMode::kDominant;
  options.placement.size = 60;
  for (const SparseTile& tile : voxelize_all(scene, options).tiles) {
    EXPECT_EQ(tile.material, tile.label);
    EXPECT_FALSE(tile.label.empty());
  }
}

TEST(Ids, solids_have_the_same_ids_by_each_pipeline) {
  VoxelizeOptions options = labelled(LabelKind::kGroup, 40);
  options.fill = Fill::kSolid;
  options.interior = Interior::kNearest;
  const Grid grid = voxelize_all(test::gored_balls(), options);
  ASSERT_FALSE(grid.tiles.empty());
  for (const SparseTile& tile : grid.tiles) {
    EXPECT_FALSE(tile.label.empty());
    EXPECT_EQ(std::ranges::count(tile.label, 0), 0);
  }
}

}  // namespace
}  // namespace voxeld::pipelines
