#include <gtest/gtest.h>
#include <zip.h>

#include <algorithm>
#include <map>
#include <string>

#include "server/formats/formats.h"
#include "server/formats/npy/npy_array.h"
#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using Members = std::map<std::string, std::vector<uint8_t>>;

// libzip checks the CRC of every member that is read to its end.
Members unzipped(const std::vector<uint8_t>& bytes) {
  Members members;
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* source = zip_source_buffer_create(bytes.data(), bytes.size(), 0, &error);
  zip_t* archive = zip_open_from_source(source, ZIP_RDONLY | ZIP_CHECKCONS, &error);
  if (archive == nullptr) {
    ADD_FAILURE() << zip_error_strerror(&error);
    zip_source_free(source);
    return members;
  }
  for (zip_int64_t i = 0; i < zip_get_num_entries(archive, 0); ++i) {
    const auto index = static_cast<zip_uint64_t>(i);
    zip_stat_t stat;
    EXPECT_EQ(zip_stat_index(archive, index, 0, &stat), 0);
    EXPECT_EQ(stat.comp_method, ZIP_CM_DEFLATE) << stat.name;
    std::vector<uint8_t> content(stat.size);
    zip_file_t* file = zip_fopen_index(archive, index, 0);
    EXPECT_EQ(zip_fread(file, content.data(), content.size()),
              static_cast<zip_int64_t>(content.size()));
    EXPECT_EQ(zip_fclose(file), 0);
    EXPECT_TRUE(members.emplace(stat.name, std::move(content)).second) << stat.name;
  }
  zip_discard(archive);
  return members;
}

Members members_of(const Grid& grid, const OutputOptions& options = {}) {
  const auto bytes = test::encode_as(Format::kNpz, grid, options);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return bytes ? unzipped(*bytes) : Members();
}

std::vector<std::string> names(const Members& members) {
  std::vector<std::string> all;
  for (const auto& [name, bytes] : members) all.push_back(name);
  return all;
}

TEST(Npz, has_a_member_for_each_channel_that_the_grid_has) {
  using Names = std::vector<std::string>;
  const std::array<int, 3> dims = {10, 11, 12};
  EXPECT_EQ(names(members_of(test::random_grid(1, dims, 50, false, false))),
            (Names{"meta.npy", "occupancy.npy", "origin.npy", "voxel_size.npy"}));
  EXPECT_EQ(names(members_of(test::random_grid(1, dims, 50, true, false))),
            (Names{"color.npy", "meta.npy", "occupancy.npy", "origin.npy", "voxel_size.npy"}));
  EXPECT_EQ(names(members_of(test::random_grid(1, dims, 50, true, true))),
            (Names{"color.npy", "meta.npy", "normal.npy", "occupancy.npy", "origin.npy",
                   "voxel_size.npy"}));
  const ChannelSet others = {.material = true, .label = true, .distance = true, .coverage = true};
  EXPECT_EQ(names(members_of(test::grid_of(dims, {{{1, 2, 3}, {}, {}}}, others))),
            (Names{"coverage.npy", "distance.npy", "label.npy", "material.npy", "meta.npy",
                   "occupancy.npy", "origin.npy", "voxel_size.npy"}));
}

TEST(Npz, members_are_the_arrays_that_npy_writes) {
  const Grid grid = test::random_grid(2, {300, 7, 12}, 400, true, true);
  for (const DType dtype : {DType::kUint8, DType::kBool, DType::kFloat32}) {
    for (const AxisOrder axes : {AxisOrder::kZyx, AxisOrder::kXyz}) {
      OutputOptions options;
      options.dtype = dtype;
      options.axes = axes;
      const Members members = members_of(grid, options);
      EXPECT_EQ(members.at("occupancy.npy"), test::npy_of(grid, std::nullopt, options));
      EXPECT_EQ(members.at("color.npy"), test::npy_of(grid, Channel::kColor, options));
      EXPECT_EQ(members.at("normal.npy"), test::npy_of(grid, Channel::kNormal, options));
    }
  }
}

TEST(Npz, has_a_row_for_each_voxel_in_layout_sparse) {
  const Grid grid = test::random_grid(2, {300, 70, 12}, 400, true, true);
  OutputOptions options;
  options.layout = ArrayLayout::kSparse;
  const Members members = members_of(grid, options);
  EXPECT_EQ(names(members),
            (std::vector<std::string>{"color.npy", "coords.npy", "dims.npy", "meta.npy",
                                      "normal.npy", "origin.npy", "voxel_size.npy"}));
  EXPECT_EQ(test::read_npy(members.at("dims.npy")).as<int64_t>(),
            (std::vector<int64_t>{300, 70, 12}));
  options.format = Format::kNpy;
  const auto npy = encode(grid, options);
  ASSERT_TRUE(npy) << npy.error().message();
  EXPECT_EQ(members.at("coords.npy"), *npy);
  const auto rows = static_cast<int64_t>(grid.voxel_count());
  EXPECT_EQ(test::read_npy(members.at("color.npy")).shape, (std::vector<int64_t>{rows, 4}));
  EXPECT_EQ(test::read_npy(members.at("normal.npy")).shape, (std::vector<int64_t>{rows, 3}));
}

TEST(Npz, says_where_the_grid_lies_and_what_made_it) {
  const Members members = members_of(test::random_grid(3, {4, 5, 6}, 9, false, false));
  const auto origin = test::read_npy(members.at("origin.npy"));
  EXPECT_EQ(origin.as<double>(), std::vector<double>({-1.5, 0.25, 1e10}));
  const auto voxel_size = test::read_npy(members.at("voxel_size.npy"));
  EXPECT_EQ(voxel_size.as<double>(), std::vector<double>({0.5, 0.25, 0.125}));
  const auto meta = test::read_npy(members.at("meta.npy"));
  EXPECT_EQ(std::string(meta.data.begin(), meta.data.end()), R"({"units":"mm"})");
}

TEST(Npz, equal_grids_give_equal_bytes) {
  Grid grid = test::random_grid(4, {600, 20, 20}, 300, true, false);
  const auto first = test::encode_as(Format::kNpz, grid);
  std::ranges::reverse(grid.tiles);
  const auto second = test::encode_as(Format::kNpz, grid);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(*first, *second);
  // Time and date of the first member: midnight of 1980-01-01, not the time of day.
  EXPECT_EQ(std::vector<uint8_t>(first->begin() + 10, first->begin() + 14),
            (std::vector<uint8_t>{0, 0, 0x21, 0}));
}

}  // namespace
}  // namespace voxeld
