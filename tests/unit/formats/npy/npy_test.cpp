#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "server/formats/formats.h"
#include "server/formats/npy/npy_array.h"
#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using Shape = std::vector<int64_t>;

// Two tiles, with cells at the corners and one in between.
const std::vector<test::TestVoxel>& voxels() {
  static const std::vector<test::TestVoxel> all = {{{0, 0, 0}, {0, 1, 10, 255}, {127, 0, -127}},
                                                   {{2, 4, 258}, {255, 188, 11, 0}, {-1, 2, -3}},
                                                   {{1, 3, 256}, {100, 200, 50, 51}, {90, -90, 0}}};
  return all;
}
Grid sample() {
  return test::grid_of({3, 5, 259}, voxels(), true, true);
}

OutputOptions options_of(DType dtype, AxisOrder axes) {
  OutputOptions options;
  options.dtype = dtype;
  options.axes = axes;
  return options;
}

// Position in the array of a cell, and of one of its channels where `channel` is not negative.
Shape position(const std::array<int, 3>& cell, AxisOrder axes, int channel = -1) {
  Shape p =
      axes == AxisOrder::kXyz ? Shape{cell[0], cell[1], cell[2]} : Shape{cell[2], cell[1], cell[0]};
  if (channel >= 0) p.push_back(channel);
  return p;
}

TEST(NpyHeader, is_a_python_dict_that_ends_at_a_multiple_of_64) {
  const auto plain = test::read_npy(npy_header("|u1", false, Shape{0, 20, 300}));
  EXPECT_EQ(plain.dict, "{'descr': '|u1', 'fortran_order': False, 'shape': (0, 20, 300, ), }");
  const auto fortran = test::read_npy(npy_header("<f4", true, Shape{0}));
  EXPECT_EQ(fortran.dict, "{'descr': '<f4', 'fortran_order': True, 'shape': (0, ), }");
}

TEST(NpyHeader, is_aligned_for_every_length_of_the_shape) {
  int64_t side = 1;
  for (int digits = 1; digits <= 18; ++digits, side *= 10) {
    for (size_t axes = 1; axes <= 4; ++axes) {
      const auto header = npy_header("|u1", false, Shape(axes, side));
      EXPECT_EQ(header.size() % 64, 0u);
      EXPECT_EQ(header.size(), 10u + header[8] + 256u * header[9]);
      EXPECT_EQ(header.back(), '\n');
    }
  }
}

TEST(NpyOccupancy, has_each_type_and_axis_order_that_is_asked_for) {
  const Grid grid = sample();
  struct Case {
    DType dtype;
    std::string descr;
  };
  for (const auto& [dtype, descr] :
       {Case{DType::kUint8, "|u1"}, Case{DType::kBool, "|b1"}, Case{DType::kFloat32, "<f4"}}) {
    for (const AxisOrder axes : {AxisOrder::kZyx, AxisOrder::kXyz}) {
      const auto bytes = test::encode_as(Format::kNpy, grid, options_of(dtype, axes));
      ASSERT_TRUE(bytes);
      const auto array = test::read_npy(*bytes);
      EXPECT_EQ(array.descr, descr);
      EXPECT_EQ(array.fortran, axes == AxisOrder::kXyz);
      EXPECT_EQ(array.shape, axes == AxisOrder::kXyz ? Shape({3, 5, 259}) : Shape({259, 5, 3}));
      std::vector<float> values = array.as<float>();
      if (dtype != DType::kFloat32) values.assign(array.data.begin(), array.data.end());
      float sum = 0;
      for (const float value : values) sum += value;
      EXPECT_EQ(sum, 3.0f);
      for (const auto& voxel : voxels()) {
        EXPECT_EQ(values[array.at(position(voxel.cell, axes))], 1.0f);
      }
    }
  }
}

TEST(NpyOccupancy, the_samples_lie_the_same_in_both_axis_orders) {
  const Grid grid = test::random_grid(1, {30, 20, 10}, 500, false, false);
  const auto zyx =
      test::read_npy(test::npy_of(grid, std::nullopt, options_of(DType::kUint8, AxisOrder::kZyx)));
  const auto xyz =
      test::read_npy(test::npy_of(grid, std::nullopt, options_of(DType::kUint8, AxisOrder::kXyz)));
  EXPECT_EQ(zyx.data, xyz.data);
}

TEST(NpyOccupancy, an_empty_grid_is_all_zeros) {
  const Grid grid = test::grid_of({4, 3, 2}, {}, false, false);
  const auto array = test::read_npy(test::npy_of(grid, std::nullopt, {}));
  EXPECT_EQ(array.shape, Shape({2, 3, 4}));
  EXPECT_EQ(array.data, std::vector<uint8_t>(24));
}

TEST(NpyOccupancy, has_all_cells_of_full_nodes_in_each_type) {
  const Grid grid = test::grid_with_a_full_brick(false, false);
  for (const DType dtype : {DType::kUint8, DType::kFloat32}) {
    const auto array =
        test::read_npy(test::npy_of(grid, std::nullopt, options_of(dtype, AxisOrder::kZyx)));
    std::vector<float> values = array.as<float>();
    if (dtype != DType::kFloat32) values.assign(array.data.begin(), array.data.end());
    for (int z = 0; z < 16; ++z) {
      for (int y = 0; y < 17; ++y) {
        for (int x = 0; x < 20; ++x) {
          const bool full = x >= 8 && x < 16 && y >= 8 && y < 16 && z >= 8;
          const bool wanted = full || (x == 0 && y == 0 && z == 0);
          ASSERT_EQ(values[array.at(position({x, y, z}, AxisOrder::kZyx))], wanted ? 1.0f : 0.0f);
        }
      }
    }
  }
}

TEST(NpyColor, voxels_of_full_nodes_are_zero_with_alpha_zero) {
  const Grid grid = test::grid_with_a_full_brick(true, true);
  const auto color = test::read_npy(test::npy_of(grid, Channel::kColor, {}));
  EXPECT_EQ(color.data[color.at(position({0, 0, 0}, AxisOrder::kZyx, 2))], 30);
  EXPECT_EQ(std::ranges::count(color.data, 0), std::ssize(color.data) - 4);
  const auto normal = test::read_npy(test::npy_of(grid, Channel::kNormal, {}));
  EXPECT_EQ(std::ranges::count(normal.data, 0), std::ssize(normal.data) - 1);
}

TEST(NpyColor, is_srgb_bytes_and_zero_where_nothing_is) {
  const Grid grid = sample();
  for (const AxisOrder axes : {AxisOrder::kZyx, AxisOrder::kXyz}) {
    for (const DType dtype : {DType::kUint8, DType::kBool}) {
      const auto array =
          test::read_npy(test::npy_of(grid, Channel::kColor, options_of(dtype, axes)));
      EXPECT_EQ(array.descr, "|u1");
      EXPECT_EQ(array.shape,
                axes == AxisOrder::kXyz ? Shape({3, 5, 259, 4}) : Shape({259, 5, 3, 4}));
      for (const auto& voxel : voxels()) {
        for (int c = 0; c < 4; ++c) {
          EXPECT_EQ(array.data[array.at(position(voxel.cell, axes, c))],
                    voxel.color[static_cast<size_t>(c)]);
        }
      }
      EXPECT_EQ(array.data[array.at(position({1, 1, 1}, axes, 0))], 0);
    }
  }
}

TEST(NpyColor, is_linear_light_and_alpha_in_0_to_1_as_float32) {
  const Grid grid = sample();
  const auto array = test::read_npy(
      test::npy_of(grid, Channel::kColor, options_of(DType::kFloat32, AxisOrder::kZyx)));
  EXPECT_EQ(array.descr, "<f4");
  const auto values = array.as<float>();
  const auto at = [&](const std::array<int, 3>& cell, int channel) {
    return values[array.at(position(cell, AxisOrder::kZyx, channel))];
  };
  // IEC 61966-2-1: linear up to 0.04045 (10/255 is below, 11/255 above), then a power.
  EXPECT_FLOAT_EQ(at({0, 0, 0}, 0), 0.0f);
  EXPECT_FLOAT_EQ(at({0, 0, 0}, 1), 1.0f / 255 / 12.92f);
  EXPECT_FLOAT_EQ(at({0, 0, 0}, 2), 10.0f / 255 / 12.92f);
  EXPECT_FLOAT_EQ(at({0, 0, 0}, 3), 1.0f);
  EXPECT_FLOAT_EQ(at({2, 4, 258}, 0), 1.0f);
  EXPECT_NEAR(at({2, 4, 258}, 1), 0.5029f, 1e-4);
  EXPECT_FLOAT_EQ(at({2, 4, 258}, 2), std::pow((11.0f / 255 + 0.055f) / 1.055f, 2.4f));
  EXPECT_FLOAT_EQ(at({1, 3, 256}, 3), 0.2f);
}

TEST(NpyNormal, is_int8_or_minus_1_to_1) {
  const Grid grid = sample();
  for (const AxisOrder axes : {AxisOrder::kZyx, AxisOrder::kXyz}) {
    const auto bytes =
        test::read_npy(test::npy_of(grid, Channel::kNormal, options_of(DType::kUint8, axes)));
    const auto floats =
        test::read_npy(test::npy_of(grid, Channel::kNormal, options_of(DType::kFloat32, axes)));
    EXPECT_EQ(bytes.descr, "|i1");
    EXPECT_EQ(floats.descr, "<f4");
    EXPECT_EQ(bytes.shape.back(), 3);
    for (const auto& voxel : voxels()) {
      for (int c = 0; c < 3; ++c) {
        const auto at = bytes.at(position(voxel.cell, axes, c));
        const int8_t expected = voxel.normal[static_cast<size_t>(c)];
        EXPECT_EQ(bytes.as<int8_t>()[at], expected);
        EXPECT_FLOAT_EQ(floats.as<float>()[at], static_cast<float>(expected) / 127);
      }
    }
  }
}

TEST(NpyIds, are_uint16_whatever_the_type_of_other_samples) {
  std::mt19937 random(1);
  const auto voxels = test::random_voxels(random, {30, 20, 10}, 90);
  const Grid grid = test::grid_of({30, 20, 10}, voxels, {.material = true, .label = true});
  for (const AxisOrder axes : {AxisOrder::kZyx, AxisOrder::kXyz}) {
    for (const DType dtype : {DType::kUint8, DType::kFloat32}) {
      const OutputOptions options = options_of(dtype, axes);
      const auto material = test::read_npy(test::npy_of(grid, Channel::kMaterial, options));
      const auto label = test::read_npy(test::npy_of(grid, Channel::kLabel, options));
      EXPECT_EQ(material.descr, "<u2");
      EXPECT_EQ(material.shape.size(), 3u);
      std::map<std::array<int, 3>, test::TestVoxel> first;
      for (const auto& voxel : voxels) first.try_emplace(voxel.cell, voxel);
      size_t sum = 0, expected_sum = 0;
      for (const uint16_t id : label.as<uint16_t>()) sum += id;
      for (const auto& [cell, voxel] : first) {
        const auto at = material.at(position(cell, axes));
        EXPECT_EQ(material.as<uint16_t>()[at], voxel.material);
        EXPECT_EQ(label.as<uint16_t>()[at], voxel.label);
        expected_sum += voxel.label;
      }
      EXPECT_EQ(sum, expected_sum) << "empty cells are 0";
    }
  }
}

TEST(NpyMeasures, distances_are_in_voxels_and_coverage_is_uint8_or_0_to_1) {
  test::TestVoxel voxel{.cell = {1, 2, 3}};
  voxel.distance = -192;
  voxel.coverage = 51;
  Grid grid = test::grid_of({16, 16, 16}, {voxel}, {.distance = true, .coverage = true});
  grid.tiles[0].full = {{morton_encode(1, 1, 1), 0}};
  const OutputOptions plain = options_of(DType::kUint8, AxisOrder::kZyx);
  const auto distance = test::read_npy(test::npy_of(grid, Channel::kDistance, plain));
  EXPECT_EQ(distance.descr, "<f4");
  EXPECT_EQ(distance.as<float>()[distance.at({3, 2, 1})], -1.5f);
  const auto coverage = test::read_npy(test::npy_of(grid, Channel::kCoverage, plain));
  EXPECT_EQ(coverage.descr, "|u1");
  EXPECT_EQ(coverage.data[coverage.at({3, 2, 1})], 51);
  EXPECT_EQ(coverage.data[coverage.at({8, 9, 15})], 255) << "of a full node";
  EXPECT_EQ(coverage.data[coverage.at({0, 0, 0})], 0);
  const auto floats = test::read_npy(
      test::npy_of(grid, Channel::kCoverage, options_of(DType::kFloat32, AxisOrder::kXyz)));
  EXPECT_FLOAT_EQ(floats.as<float>()[floats.at({1, 2, 3})], 0.2f);
  EXPECT_EQ(floats.as<float>()[floats.at({15, 9, 8})], 1.0f);
}

TEST(NpyMeasures, distances_in_world_units_are_multiples_of_the_shortest_edge) {
  test::TestVoxel voxel{.cell = {1, 2, 3}};
  voxel.distance = -192;
  Grid grid = test::grid_of({16, 16, 16}, {voxel}, {.distance = true});
  grid.spec.voxel_size = {0.5, 3, 0.25};
  grid.meta = GridMeta::parse(R"({"options":{"distance":"world"}})");
  grid.tiles[0].full = {{morton_encode(1, 1, 1), 0}};
  const auto distance = test::read_npy(
      test::npy_of(grid, Channel::kDistance, options_of(DType::kUint8, AxisOrder::kZyx)));
  EXPECT_EQ(distance.as<float>()[distance.at({3, 2, 1})], -0.375f);
  EXPECT_EQ(distance.as<float>()[distance.at({8, 9, 15})], -0.375f) << "of a full node";
  EXPECT_EQ(distance.as<float>()[distance.at({0, 0, 0})], 0.375f) << "of an empty cell";
}

TEST(NpyArrays, of_numbers_and_of_text) {
  const double numbers[] = {1.5, -2, 1e300};
  const auto doubles = test::read_npy(npy_doubles(numbers));
  EXPECT_EQ(doubles.descr, "<f8");
  EXPECT_EQ(doubles.shape, Shape({3}));
  EXPECT_EQ(doubles.as<double>(), std::vector<double>({1.5, -2, 1e300}));
  const auto text = test::read_npy(npy_text("{\"a\":1}"));
  EXPECT_EQ(text.descr, "|u1");
  EXPECT_EQ(std::string(text.data.begin(), text.data.end()), "{\"a\":1}");
  EXPECT_EQ(test::read_npy(npy_text("")).shape, Shape({0}));
}

}  // namespace
}  // namespace voxeld
