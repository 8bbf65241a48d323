// Raw arrays in a zip against the arrays of npy, and their headers.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "server/formats/formats.h"
#include "tests/unit/formats/images/image_samples.h"
#include "tests/unit/formats/zip/zip_members.h"

namespace voxeld {
namespace {

test::ZipMembers raw_members(const Grid& grid, OutputOptions options = {}) {
  const auto bytes = test::encode_as(Format::kRaw, grid, options);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  test::ZipMembers members(*bytes);
  EXPECT_EQ(members.all().size(), 2U);
  EXPECT_EQ(members.all()[0].name, "grid.nhdr");
  EXPECT_EQ(members.all()[1].name, "grid.raw");
  return members;
}

TEST(Raw, bytes_of_each_channel_and_type_are_those_of_npy) {
  for (const glm::dvec3 size : {glm::dvec3(0.25), glm::dvec3(0.5, 0.25, 0.125)}) {
    const Grid grid = test::grid_of_every_channel(size);
    for (const DType dtype : {DType::kUint8, DType::kBool, DType::kFloat32}) {
      for (const std::optional<Channel> channel : test::arrays_of_grid(grid)) {
        OutputOptions options;
        options.dtype = dtype;
        options.channel = channel;
        EXPECT_TRUE(raw_members(grid, options).at("grid.raw") ==
                    test::world_samples_of(grid, channel, dtype))
            << (channel ? channel_info(*channel).name : "occupancy");
      }
    }
  }
}

TEST(Raw, header_is_a_detached_one_of_nrrd) {
  OutputOptions options;
  options.channel = Channel::kDistance;
  const Grid grid = test::grid_of_every_channel({0.5, 0.25, 0.125});
  EXPECT_EQ(raw_members(grid, options).text("grid.nhdr"),
            "NRRD0004\n# voxeld\ntype: float\ndimension: 3\nspace: 3D-right-handed\n"
            "sizes: 70 40 33\nspace directions: (0.5,0,0) (0,0.25,0) (0,0,0.125)\n"
            "centers: cell cell cell\nkinds: domain domain domain\nendian: little\n"
            "encoding: raw\ndata file: grid.raw\nspace units: \"mm\" \"mm\" \"mm\"\n"
            "space origin: (-1.25,0.375,10000000000.0625)\ncontent: distance\nunits:=mm\n"
            R"(meta:={"labels":[{"id":1,"name":"a \\"roof\\""}],"units":"mm"})"
            "\n");
}

TEST(Raw, an_empty_grid_is_zeros) {
  const Grid grid = test::grid_of({3, 4, 5}, {}, true, false);
  OutputOptions options;
  options.channel = Channel::kColor;
  EXPECT_EQ(raw_members(grid, options).at("grid.raw"), std::vector<uint8_t>(3 * 4 * 5 * 4));
  EXPECT_NE(raw_members(grid, options).text("grid.nhdr").find("sizes: 4 3 4 5\n"),
            std::string::npos);
}

TEST(Raw, equal_grids_give_equal_bytes) {
  const Grid grid = test::random_grid(5, {300, 90, 53}, 5000, true, false);
  OutputOptions options;
  options.channel = Channel::kColor;
  EXPECT_TRUE(*test::encode_as(Format::kRaw, grid, options) ==
              *test::encode_as(Format::kRaw, grid, options));
}

}  // namespace
}  // namespace voxeld
