// Points and Qubicle's matrices against the sparse arrays of npz, and pinned texts and bytes.
#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "server/formats/formats.h"
#include "server/formats/npy/sparse_array.h"
#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using test::to;
using Bytes = std::vector<uint8_t>;

Bytes encoded(const Grid& grid, Format format) {
  auto bytes = encode(grid, to(format));
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return bytes ? *std::move(bytes) : Bytes();
}

std::string text_of(const Bytes& bytes) {
  return {bytes.begin(), bytes.end()};
}

// Two voxels with all channels, in cells of half a unit.
Grid two_voxels(const ChannelSet& channels) {
  Grid grid = test::grid_of({20, 17, 16},
                            {{.cell = {0, 1, 2},
                              .color = {10, 20, 30, 200},
                              .normal = {0, 127, -127},
                              .material = 7,
                              .label = 65535,
                              .distance = -64,
                              .coverage = 51},
                             {.cell = {3, 1, 2}, .color = {1, 2, 3, 255}}},
                            channels);
  grid.spec.origin_world = {-1.5, 0.25, 3};
  grid.spec.voxel_size = glm::dvec3(0.5);
  return grid;
}

TEST(Csv, pinned_text_of_every_channel_and_of_a_full_node) {
  Grid grid = two_voxels(channels_of_bits(~uint32_t{0}));
  EXPECT_EQ(text_of(encoded(grid, Format::kCsv)),
            "x,y,z,px,py,pz,r,g,b,a,nx,ny,nz,material,label,distance,coverage\n"
            "0,1,2,-1.25,1,4.25,10,20,30,200,0,1,-1,7,65535,-0.25,0.2\n"
            "3,1,2,0.25,1,4.25,1,2,3,255,0,0,0,0,0,0,0\n");
  grid.tiles[0].full = {{morton_encode(1, 1, 1), 0}};
  const std::string text = text_of(encoded(grid, Format::kCsv));
  EXPECT_EQ(std::ranges::count(text, '\n'), 3 + 512);
  EXPECT_TRUE(text.ends_with("\n15,15,15,6.25,8,10.75,0,0,0,0,0,0,0,0,0,-0.25,1\n"));
}

TEST(Csv, a_grid_without_channels_has_cells_and_centres) {
  EXPECT_EQ(text_of(encoded(two_voxels({}), Format::kCsv)),
            "x,y,z,px,py,pz\n0,1,2,-1.25,1,4.25\n3,1,2,0.25,1,4.25\n");
}

TEST(Csv, has_the_cells_of_sparse_arrays_in_their_order) {
  const Grid grid = test::random_grid(4, {300, 270, 40}, 9000, false, false);
  const VoxelPieces voxels(grid);
  const SparseArray coords = SparseArray::coords(voxels, std::nullopt);
  std::istringstream lines(text_of(encoded(grid, Format::kCsv)));
  std::string line;
  std::getline(lines, line);
  uint64_t count = 0;
  for (size_t piece = 0; piece < coords.piece_count(); ++piece) {
    Bytes rows(coords.piece_bytes(piece));
    coords.fill(piece, rows);
    for (size_t at = 0; at < rows.size(); at += 12, ++count) {
      std::array<int32_t, 3> cell{};
      std::memcpy(cell.data(), &rows[at], sizeof cell);
      ASSERT_TRUE(std::getline(lines, line));
      const std::string begin = std::to_string(cell[0]) + "," + std::to_string(cell[1]) + "," +
                                std::to_string(cell[2]) + ",";
      ASSERT_TRUE(line.starts_with(begin)) << line;
    }
  }
  EXPECT_FALSE(std::getline(lines, line));
  EXPECT_EQ(count, grid.voxel_count());
}

TEST(Csv, more_voxels_than_lines_may_be_are_refused) {
  Grid grid;
  grid.spec.dims = {4 * limits::kTileSide + 8, limits::kTileSide, limits::kTileSide};
  for (int x = 0; x < 5; ++x) {
    SparseTile& tile = grid.tiles.emplace_back();
    tile.coord = {x, 0, 0};
    tile.full = {{0, x < 4 ? kTileLevels : 0}};
  }
  EXPECT_EQ(encode(grid, to(Format::kCsv)).error().message(),
            "csv: too many voxels for lines: expected at most 67108864, got 67109376");
}

TEST(Pcd, pinned_header_and_records) {
  const Grid grid = two_voxels(channels_of_bits(~uint32_t{0}));
  const Bytes bytes = encoded(grid, Format::kPcd);
  const std::string text = text_of(bytes);
  const size_t begin = text.find("DATA binary\n") + 12;
  EXPECT_EQ(text.substr(0, begin),
            "# .PCD v0.7 - Point Cloud Data file format\n# voxeld\n# dims 20 17 16\n"
            "# origin -1.5 0.25 3\n# voxel_size 0.5 0.5 0.5\n# units mm\nVERSION 0.7\n"
            "FIELDS x y z rgb normal_x normal_y normal_z material label distance coverage\n"
            "SIZE 4 4 4 4 4 4 4 4 4 4 4\nTYPE F F F F F F F U U F F\n"
            "COUNT 1 1 1 1 1 1 1 1 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
            "POINTS 2\nDATA binary\n");
  ASSERT_EQ(bytes.size(), begin + size_t{2} * 44);
  const auto number = [&](size_t field, auto value) {
    std::memcpy(&value, &bytes[begin + 4 * field], sizeof value);
    return value;
  };
  const float expected[] = {-1.25, 1, 4.25};
  for (size_t i = 0; i < 3; ++i) EXPECT_EQ(number(i, 0.0F), expected[i]);
  EXPECT_EQ(number(3, 0U), 0x000a141eU);
  EXPECT_EQ(number(5, 0.0F), 1.0F);
  EXPECT_EQ(number(6, 0.0F), -1.0F);
  EXPECT_EQ(number(7, 0U), 7U);
  EXPECT_EQ(number(8, 0U), 65535U);
  EXPECT_EQ(number(9, 0.0F), -0.25F);
  EXPECT_EQ(number(10, 0.0F), 0.2F);
}

TEST(Pcd, coordinates_that_floats_do_not_hold_are_doubles) {
  Grid grid = two_voxels({});
  grid.spec.origin_world.x = 1e9;
  const Bytes bytes = encoded(grid, Format::kPcd);
  EXPECT_NE(text_of(bytes).find("SIZE 8 8 8\nTYPE F F F\n"), std::string::npos);
  double x = 0;
  std::memcpy(&x, &bytes[bytes.size() - 24], sizeof x);
  EXPECT_EQ(x, 1e9 + 1.75);
}

uint32_t u32_at(const Bytes& bytes, size_t& at) {
  uint32_t value = 0;
  EXPECT_LE(at + 4, bytes.size());
  if (at + 4 <= bytes.size()) std::memcpy(&value, &bytes[at], sizeof value);
  at += 4;
  return value;
}

struct QbFile {
  size_t matrices = 0;
  std::map<std::array<int, 3>, uint32_t> cells;  // of the grid
};

QbFile read_qb(const Bytes& bytes) {
  QbFile file;
  size_t at = 0;
  const uint32_t header[] = {0x00000101, 0, 0, 1, 0};
  for (const uint32_t expected : header) EXPECT_EQ(u32_at(bytes, at), expected);
  file.matrices = u32_at(bytes, at);
  for (size_t m = 0; m < file.matrices; ++m) {
    at += 1 + bytes[at];
    std::array<int, 3> size{}, place{};
    for (int& side : size) side = static_cast<int>(u32_at(bytes, at));
    for (int& cell : place) cell = static_cast<int>(u32_at(bytes, at));
    for (int z = 0; z < size[2]; ++z) {
      int cell = 0;
      for (uint32_t code = u32_at(bytes, at); code != 6; code = u32_at(bytes, at)) {
        const uint32_t count = code == 2 ? u32_at(bytes, at) : 1;
        const uint32_t color = code == 2 ? u32_at(bytes, at) : code;
        for (uint32_t i = 0; i < count; ++i, ++cell) {
          if (color == 0) continue;
          const int x = place[0] + cell % size[0], y = place[1] + cell / size[0];
          EXPECT_TRUE(file.cells.emplace(std::array{x, y, place[2] + z}, color).second);
        }
      }
      EXPECT_EQ(cell, size[0] * size[1]);
      if (at >= bytes.size()) break;
    }
  }
  EXPECT_EQ(at, bytes.size());
  return file;
}

TEST(Qubicle, has_each_voxel_and_its_colour_at_its_cell) {
  for (const std::array<int, 3>& dims :
       {std::array{40, 30, 20}, std::array{300, 20, 530}, std::array{5, 600, 7}}) {
    std::mt19937 random(9);
    auto voxels = test::random_voxels(random, dims, 1500);
    for (auto& voxel : voxels) voxel.color[3] = static_cast<uint8_t>(random());
    Grid grid = test::grid_of(dims, voxels, {.color = true});
    std::map<std::array<int, 3>, uint32_t> expected;
    for (const auto& voxel : voxels) {
      expected.try_emplace(voxel.cell, voxel.color[0] | uint32_t{voxel.color[1]} << 8 |
                                           uint32_t{voxel.color[2]} << 16 | 0xff000000U);
    }
    const QbFile file = read_qb(encoded(grid, Format::kQb));
    EXPECT_TRUE(file.cells == expected) << dims[0];
    EXPECT_EQ(file.matrices, grid.tiles.size());
  }
}

TEST(Qubicle, full_nodes_have_the_mean_colour) {
  const Grid grid = test::grid_with_a_full_brick(true, false);
  const QbFile file = read_qb(encoded(grid, Format::kQb));
  EXPECT_EQ(file.cells.size(), 513U);
  EXPECT_EQ(file.cells.at({15, 15, 15}), 0xff1e140aU);
  EXPECT_EQ(file.cells.at({0, 0, 0}), 0xff1e140aU);
}

TEST(Points, voxels_inside_of_a_solid_have_the_mean_colour) {
  const Grid grid = test::grid_of(
      {16, 16, 16}, {{.cell = {0, 0, 0}, .color = {200, 10, 10, 255}}, {.cell = {1, 0, 0}}},
      ChannelSet{.color = true});
  EXPECT_EQ(read_qb(encoded(grid, Format::kQb)).cells.at({1, 0, 0}), 0xff0a0ac8U);
  const Bytes pcd = encoded(grid, Format::kPcd);
  size_t last = pcd.size() - 4;
  EXPECT_EQ(u32_at(pcd, last), 0x00c80a0aU);
  EXPECT_TRUE(text_of(encoded(grid, Format::kXyz)).ends_with(" 200 10 10\n"));
  EXPECT_TRUE(text_of(encoded(grid, Format::kCsv)).ends_with(",0,0,0,0\n"));
}

TEST(Qubicle, pinned_bytes_of_a_row) {
  Grid grid = test::grid_of({5, 1, 1}, {{.cell = {0, 0, 0}, .color = {1, 2, 3, 255}}},
                            ChannelSet{.color = true});
  EXPECT_EQ(
      encoded(grid, Format::kQb),
      (Bytes{1,  1,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   1,   0, 0, 0, 0, 0, 0, 0,
             1,  0,   0,   0,                                                 //
             12, 'v', 'o', 'x', 'e', 'l', 'd', ' ', '0', ' ', '0', ' ', '0',  //
             5,  0,   0,   0,   1,   0,   0,   0,   1,   0,   0,   0,   0,   0, 0, 0, 0, 0, 0, 0,
             0,  0,   0,   0,  //
             1,  2,   3,   255, 2,   0,   0,   0,   4,   0,   0,   0,   0,   0, 0, 0, 6, 0, 0, 0}));
}

TEST(Qubicle, a_grid_without_voxels_is_one_empty_matrix) {
  Grid grid;
  grid.spec.dims = {3, 2, 300};
  const QbFile file = read_qb(encoded(grid, Format::kQb));
  EXPECT_EQ(file.matrices, 1U);
  EXPECT_TRUE(file.cells.empty());
}

}  // namespace
}  // namespace voxeld
