// binvox, npy, nrrd and voxg: what our encoders write, files made from the specifications with the
// cells that they hold, and broken files with the errors that they give.
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "proto/limits.h"
#include "server/formats/formats.h"
#include "server/volumes/volume.h"
#include "server/volumes/volume_files.h"
#include "tests/unit/base/points_passed.h"
#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using test::to;
using volumes::read_binvox;
using volumes::read_npy;
using volumes::read_nrrd;
using Bytes = std::vector<uint8_t>;
using Cell = std::array<int, 3>;  // x, y, z
using Cells = std::set<Cell>;

Bytes bytes_of(std::string_view text) {
  return {text.begin(), text.end()};
}

Bytes encoded(const Grid& grid, const OutputOptions& options) {
  auto bytes = encode(grid, options);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return bytes ? *std::move(bytes) : Bytes();
}

Grid loaded(const Bytes& bytes, double threshold = 0.5) {
  auto volume = load_volume("a", bytes, threshold);
  EXPECT_TRUE(volume) << (volume ? "" : volume.error().message());
  return volume ? std::move(volume->grid) : Grid();
}

Cells cells_of(const Grid& grid) {
  Cells cells;
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t) { cells.insert({x, y, z}); });
  }
  return cells;
}

// The tiles without attributes.
std::vector<SparseTile> occupancy(const Grid& grid) {
  std::vector<SparseTile> tiles = grid.tiles;
  for (SparseTile& tile : tiles) {
    for_each_channel(tile, [](Channel, auto& samples) { samples.clear(); });
    canonicalize(tile);
  }
  return tiles;
}

// Rows of several words, more than one block in a slab of planes, several tiles, full bricks.
Grid large_grid(const ChannelSet& channels = {}) {
  std::mt19937 random(5);
  auto voxels = test::random_voxels(random, {600, 301, 37}, 4000);
  for (const auto& box : {test::box_voxels({255, 254, 7}, {258, 258, 34}),
                          test::box_voxels({16, 16, 0}, {32, 32, 17})}) {
    voxels.insert(voxels.end(), box.begin(), box.end());
  }
  for (test::TestVoxel& voxel : voxels) voxel.color[3] = std::max<uint8_t>(voxel.color[3], 1);
  return test::grid_of({600, 301, 37}, voxels, channels);
}

using Colors = std::map<Cell, std::array<uint8_t, 4>>;
Colors colors_of(const Grid& grid) {
  Colors colors;
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      std::copy_n(&tile.color[4 * voxel], 4, colors[{x, y, z}].begin());
    });
  }
  return colors;
}

void expect_place(const GridSpec& spec, const GridSpec& expected) {
  EXPECT_EQ(spec.dims, expected.dims);
  for (int c = 0; c < 3; ++c) {
    EXPECT_DOUBLE_EQ(spec.origin_world[c], expected.origin_world[c]);
    EXPECT_DOUBLE_EQ(spec.voxel_size[c], expected.voxel_size[c]);
  }
}

std::string error_of(const Result<Volume>& volume) {
  return volume ? "no error" : volume.error().message();
}

// Every file that ends too early gives an error.
void expect_truncations_fail(const Bytes& bytes,
                             const std::function<Result<Volume>(std::span<const uint8_t>)>& read) {
  ASSERT_TRUE(read(bytes)) << read(bytes).error().message();
  for (size_t size = 0; size < bytes.size(); ++size) {
    const Bytes part(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(size));
    const auto volume = read(part);
    ASSERT_FALSE(volume) << size;
    EXPECT_EQ(volume.error().code == ErrorCode::kMalformedMesh ||
                  volume.error().code == ErrorCode::kUnsupportedFeature,
              true)
        << size << volume.error().message();
  }
}

// binvox

Bytes binvox(const std::string& header, const std::vector<std::pair<int, int>>& runs) {
  Bytes bytes = bytes_of(header);
  for (const auto& [value, count] : runs) {
    bytes.push_back(static_cast<uint8_t>(value));
    bytes.push_back(static_cast<uint8_t>(count));
  }
  return bytes;
}

TEST(BinvoxVolume, what_the_encoder_writes_reads_back) {
  Grid grid = large_grid();
  grid.spec.voxel_size = glm::dvec3(0.3);
  const Grid read = loaded(encoded(grid, to(Format::kBinvox)));
  EXPECT_EQ(read.tiles, occupancy(grid));
  GridSpec expected = grid.spec;
  expected.dims = glm::ivec3(600);
  expect_place(read.spec, expected);
  EXPECT_FALSE(read.channels.any());
}

TEST(BinvoxVolume, a_small_file_has_its_cells_in_its_place) {
  // y is the fastest, then z, then x.
  const Bytes bytes = binvox("#binvox 1\ndim 2 2 2\ntranslate -1.5 2 1e3\nscale 5\ndata\n",
                             {{0, 1}, {1, 2}, {0, 4}, {1, 1}});
  const Grid grid = loaded(bytes);
  EXPECT_EQ(cells_of(grid), (Cells{{0, 1, 0}, {0, 0, 1}, {1, 1, 1}}));
  expect_place(grid.spec, {glm::ivec3(2), {-1.5, 2, 1000}, glm::dvec3(2.5)});
}

TEST(BinvoxVolume, sides_may_differ_and_lines_end_with_crlf) {
  const Bytes bytes =
      binvox("#binvox 1\r\nscale 8\r\ndim 4 1 3\r\ndata\r\n", {{0, 5}, {1, 1}, {0, 6}});
  const Grid grid = loaded(bytes);  // x 4, z 1, y 3
  EXPECT_EQ(cells_of(grid), (Cells{{1, 2, 0}}));
  expect_place(grid.spec, {{4, 3, 1}, glm::dvec3(0), glm::dvec3(2)});
}

TEST(BinvoxVolume, without_a_place_the_grid_is_at_0_with_voxels_of_1) {
  expect_place(loaded(binvox("#binvox 1\ndim 3 3 3\ndata\n", {{1, 27}})).spec,
               {glm::ivec3(3), glm::dvec3(0), glm::dvec3(1)});
}

TEST(BinvoxVolume, runs_go_through_rows_and_planes) {
  Bytes bytes = bytes_of("#binvox 1\ndim 70 70 70\ndata\n");
  Cells expected;
  size_t at = 0;
  std::mt19937 random(1);
  for (bool value = false; at < 343'000; value = !value) {
    const size_t count = std::min<size_t>(1 + random() % 255, 343'000 - at);
    bytes.push_back(value ? 1 : 0);
    bytes.push_back(static_cast<uint8_t>(count));
    for (size_t i = at; value && i < at + count; ++i) {
      expected.insert(
          {static_cast<int>(i / 4900), static_cast<int>(i % 70), static_cast<int>(i / 70 % 70)});
    }
    at += count;
  }
  EXPECT_TRUE(cells_of(loaded(bytes)) == expected);
}

TEST(BinvoxVolume, more_voxels_than_a_grid_may_have_are_refused) {
  Bytes bytes = bytes_of("#binvox 1\ndim 645 645 645\ndata\n");
  const size_t cells = 645 * 645 * 645;  // 2^28 is 645.08 cubed; all but a few of the next side
  for (size_t at = 0; at < cells; at += 255) {
    bytes.push_back(1);
    bytes.push_back(static_cast<uint8_t>(std::min<size_t>(255, cells - at)));
  }
  EXPECT_EQ(loaded(bytes).voxel_count(), cells);
  Bytes more = bytes_of("#binvox 1\ndim 646 646 646\ndata\n");
  const size_t more_cells = 646 * 646 * 646;
  for (size_t at = 0; at < more_cells; at += 255) {
    more.push_back(1);
    more.push_back(static_cast<uint8_t>(std::min<size_t>(255, more_cells - at)));
  }
  EXPECT_EQ(error_of(read_binvox("a.binvox", more)),
            "a.binvox: too many voxels: expected at most 268435456, got more");
}

TEST(BinvoxVolume, broken_files_say_what_is_wrong) {
  const std::string head = "#binvox 1\ndim 2 2 2\ndata\n";
  const std::pair<Bytes, std::string> kTable[] = {
      {bytes_of(""), R"(a.binvox: line 1: not version 1 of binvox: expected "#binvox 1", got "")"},
      {bytes_of("#binvox 2\n"),
       R"(a.binvox: line 1: not version 1 of binvox: expected "#binvox 1", got "#binvox 2")"},
      {bytes_of("#binvox 1\ndim 2 2 2\n"),
       R"(a.binvox: header: the file ends: expected a line "data")"},
      {bytes_of("#binvox 1\ndata\n"),
       R"(a.binvox: header: sides are missing: expected a line "dim")"},
      {bytes_of("#binvox 1\ndim 2 2\ndata\n"),
       R"(a.binvox: dim: sides of the grid: expected 3 numbers from 1 on, got "2 2")"},
      {bytes_of("#binvox 1\ndim 2 0 2\ndata\n"),
       R"(a.binvox: dim: sides of the grid: expected 3 numbers from 1 on, got "2 0 2")"},
      {bytes_of("#binvox 1\ndim 2 -2 2\ndata\n"),
       R"(a.binvox: dim: sides of the grid: expected 3 numbers from 1 on, got "2 -2 2")"},
      {bytes_of("#binvox 1\ndim 16385 1 2\ndata\n"),
       "a.binvox: too many cells on a side: expected at most 16384, got 16385 x 2 x 1"},
      {bytes_of("#binvox 1\ndim 2 2 2\ndim 2 2 2\n"), "a.binvox: dim: the line is there twice"},
      {bytes_of("#binvox 1\ntranslate 0 nan 0\n"),
       "a.binvox: translate: corner of the grid: expected 3 numbers of at "
       "most 1e30, got \"0 nan 0\""},
      {bytes_of("#binvox 1\nscale 0\n"),
       R"(a.binvox: scale: side of the grid: expected a number from 1e-25 to 1e30, got "0")"},
      {bytes_of("#binvox 1\nscale 1 2\n"),
       R"(a.binvox: scale: side of the grid: expected a number from 1e-25 to 1e30, got "1 2")"},
      {bytes_of("#binvox 1\nsize \x01 3\n"),
       R"(a.binvox: header: unknown line: expected dim, translate, scale or data, got "size . 3")"},
      {binvox(head, {}), "a.binvox: data: too few runs for the cells: expected at least 1, got 0"},
      {binvox("#binvox 1\ndim 16384 16384 16384\ndata\n", {{0, 255}, {1, 255}}),
       "a.binvox: data: too few runs for the cells: expected at least 17247241221, got 2"},
      {binvox(head, {{0, 7}}),
       "a.binvox: data: the runs are not those of the cells: expected 8 cells, got 7"},
      {binvox(head, {{0, 7}, {1, 2}}),
       "a.binvox: data: the runs are not those of the cells: expected 8 cells, got 9"},
      {binvox(head, {{0, 4}, {2, 4}}),
       "a.binvox: byte 27: a run: expected value 0 or 1 and a count from 1 on, got value 2, count "
       "4"},
      {binvox(head, {{0, 8}, {1, 0}}),
       "a.binvox: byte 27: a run: expected value 0 or 1 and a count from 1 on, got value 1, count "
       "0"},
      {bytes_of(head + "\x01\x08\x01"),
       "a.binvox: byte 27: half a run: expected a value and a count, got the end of the file"},
  };
  for (const auto& [bytes, message] : kTable) {
    EXPECT_EQ(error_of(read_binvox("a.binvox", bytes)), message);
  }
}

TEST(BinvoxVolume, every_truncation_is_refused) {
  expect_truncations_fail(
      binvox("#binvox 1\ndim 2 2 2\ntranslate 0 0 0\nscale 1\ndata\n", {{0, 3}, {1, 5}}),
      [](std::span<const uint8_t> bytes) { return read_binvox("a", bytes); });
}

// npy

Bytes npy(const std::string& dictionary, const Bytes& samples, int major = 1) {
  Bytes bytes = bytes_of("\x93NUMPY");
  bytes.push_back(static_cast<uint8_t>(major));
  bytes.push_back(0);
  for (int i = 0; i < (major == 1 ? 2 : 4); ++i) {
    bytes.push_back(static_cast<uint8_t>(dictionary.size() >> 8 * i));
  }
  bytes.insert(bytes.end(), dictionary.begin(), dictionary.end());
  bytes.insert(bytes.end(), samples.begin(), samples.end());
  return bytes;
}

std::string dictionary(const std::string& descr, bool is_fortran, const std::string& shape) {
  return "{'descr': '" + descr + "', 'fortran_order': " + (is_fortran ? "True" : "False") +
         ", 'shape': " + shape + ", }\n";
}

template <typename T>
void append(Bytes& bytes, T value, bool is_big_endian) {
  std::array<uint8_t, sizeof(T)> raw{};
  std::memcpy(raw.data(), &value, sizeof value);
  if (is_big_endian) std::ranges::reverse(raw);
  bytes.insert(bytes.end(), raw.begin(), raw.end());
}

TEST(NpyVolume, what_the_encoder_writes_reads_back) {
  const Grid grid = large_grid();
  for (const DType dtype : {DType::kBool, DType::kUint8, DType::kFloat32}) {
    OutputOptions options = to(Format::kNpy);
    options.dtype = dtype;
    const Grid read = loaded(encoded(grid, options));
    EXPECT_EQ(read.tiles, occupancy(grid));
    expect_place(read.spec, {grid.spec.dims, glm::dvec3(0), glm::dvec3(1)});
  }
}

TEST(NpyVolume, axis_order_xyz_exchanges_x_and_z) {
  const Grid grid = test::random_grid(3, {70, 20, 33}, 300, false, false);
  OutputOptions options = to(Format::kNpy);
  options.axes = AxisOrder::kXyz;
  Cells expected;
  for (const auto& [x, y, z] : cells_of(grid)) expected.insert({z, y, x});
  const Grid read = loaded(encoded(grid, options));
  EXPECT_EQ(cells_of(read), expected);
  EXPECT_EQ(read.spec.dims, glm::ivec3(33, 20, 70));
}

TEST(NpyVolume, colors_read_back_whatever_their_type) {
  const Grid grid = large_grid({.color = true});
  for (const DType dtype : {DType::kUint8, DType::kFloat32}) {
    OutputOptions options = to(Format::kNpy);
    options.dtype = dtype;
    const Grid read = loaded(test::npy_of(grid, Channel::kColor, options));
    EXPECT_TRUE(read.tiles == grid.tiles);
    EXPECT_TRUE(read.channels == grid.channels);
  }
}

TEST(NpyVolume, planar_colors_of_fortran_order_read_back) {
  const Grid grid = large_grid({.color = true});
  for (const DType dtype : {DType::kUint8, DType::kFloat32}) {
    OutputOptions options = to(Format::kNpy);
    options.dtype = dtype;
    options.axes = AxisOrder::kXyz;
    Colors expected;
    for (const auto& [cell, color] : colors_of(grid)) expected[{cell[2], cell[1], cell[0]}] = color;
    EXPECT_TRUE(colors_of(loaded(test::npy_of(grid, Channel::kColor, options))) == expected);
  }
}

// The values of an array of sides z 3, y 2, x 5, in C order, and the cells of those at least 3.
constexpr int kValues[30] = {0, 1, 2, 3, 4, 3, 0, 0, 0, 0, 9, 1, 1, 1, 1,
                             0, 0, 0, 0, 3, 2, 2, 2, 2, 2, 7, 0, 2, 0, 100};
const Cells kCellsFrom3 = {{3, 0, 0}, {4, 0, 0}, {0, 1, 0}, {0, 0, 1},
                           {4, 1, 1}, {0, 1, 2}, {4, 1, 2}};

// Bytes of kValues, or in Fortran order.
template <typename Encode>
Bytes value_bytes(bool is_fortran, const Encode& encode) {
  Bytes bytes;
  for (int i = 0; i < 30; ++i) {
    const int x = i / 6, y = i / 3 % 2, z = i % 3;  // z is the fastest
    encode(bytes, kValues[is_fortran ? (z * 2 + y) * 5 + x : i]);
  }
  return bytes;
}

template <typename T>
void expect_type(const std::string& word) {
  for (const bool is_fortran : {false, true}) {
    for (const bool is_big_endian : {false, true}) {
      const std::string order = sizeof(T) == 1 ? "|" : is_big_endian ? ">" : "<";
      const Bytes bytes = value_bytes(is_fortran, [&](Bytes& out, int value) {
        append(out, static_cast<T>(value), is_big_endian);
      });
      const Grid grid = loaded(npy(dictionary(order + word, is_fortran, "(3, 2, 5)"), bytes), 3);
      EXPECT_EQ(cells_of(grid), kCellsFrom3) << order << word << is_fortran;
      EXPECT_EQ(grid.spec.dims, glm::ivec3(5, 2, 3));
    }
  }
}

TEST(NpyVolume, numbers_of_every_type_and_order_read) {
  expect_type<int8_t>("i1");
  expect_type<uint8_t>("u1");
  expect_type<int16_t>("i2");
  expect_type<uint16_t>("u2");
  expect_type<int32_t>("i4");
  expect_type<uint32_t>("u4");
  expect_type<int64_t>("i8");
  expect_type<uint64_t>("u8");
  expect_type<float>("f4");
  expect_type<double>("f8");
}

TEST(NpyVolume, headers_of_every_version_and_spelling_read) {
  const Bytes samples(8, 1);
  for (const int major : {1, 2, 3}) {
    EXPECT_EQ(loaded(npy(dictionary("|u1", false, "(2, 2, 2)"), samples, major)).voxel_count(), 8);
  }
  for (const std::string text :
       {"{'shape':(2,2,2),'fortran_order':False,'descr':'|u1'}",
        " { \"shape\" : ( 2L , 2L , 2L , ) , \"descr\" : \"<u1\" , 'fortran_order' : True } \n\n",
        "{'descr': '|b1', 'fortran_order': True, 'shape': (2, 2, 2), }          \n"}) {
    EXPECT_EQ(loaded(npy(text, samples)).voxel_count(), 8) << text;
  }
}

// Whether samples of a row of one cell each are voxels.
template <typename T>
std::string voxels_from(const std::string& descr, double threshold, const std::vector<T>& values) {
  Bytes bytes;
  for (const T value : values) append(bytes, value, false);
  const std::string shape = "(1, 1, " + std::to_string(values.size()) + ")";
  const Cells cells = cells_of(loaded(npy(dictionary(descr, false, shape), bytes), threshold));
  std::string text;
  for (int i = 0; i < static_cast<int>(values.size()); ++i) {
    text += cells.contains({i, 0, 0}) ? '1' : '0';
  }
  return text;
}

TEST(NpyVolume, a_sample_of_at_least_the_threshold_is_a_voxel) {
  EXPECT_EQ(voxels_from<uint8_t>("|b1", 1, {0, 1, 2, 255}), "0111");
  EXPECT_EQ(voxels_from<uint8_t>("|b1", 1.5, {0, 1, 2, 255}), "0000");
  EXPECT_EQ(voxels_from<uint8_t>("|u1", 127.5, {0, 127, 128, 255}), "0011");
  EXPECT_EQ(voxels_from<uint8_t>("|u1", 255, {0, 255}), "01");
  EXPECT_EQ(voxels_from<uint8_t>("|u1", 255.5, {0, 255}), "00");
  EXPECT_EQ(voxels_from<uint8_t>("|u1", 0, {0, 255}), "11");
  EXPECT_EQ(voxels_from<uint8_t>("|u1", -1e30, {0, 255}), "11");
  EXPECT_EQ(voxels_from<int8_t>("|i1", -3, {-128, -4, -3, 0, 127}), "00111");
  EXPECT_EQ(voxels_from<int8_t>("|i1", -2.5, {-128, -3, -2, 0, 127}), "00111");
  EXPECT_EQ(voxels_from<int64_t>("<i8", 0x1p62, {INT64_MAX, (int64_t{1} << 62) - 1, INT64_MIN}),
            "100");
  EXPECT_EQ(voxels_from<int64_t>("<i8", 0x1p63, {INT64_MAX, INT64_MIN}), "00");
  EXPECT_EQ(voxels_from<uint64_t>("<u8", 0x1p63, {UINT64_MAX, INT64_MAX, 0}), "100");
  EXPECT_EQ(voxels_from<uint64_t>("<u8", 1e30, {UINT64_MAX, INT64_MAX, 0}), "000");
  const float inf = std::numeric_limits<float>::infinity();
  EXPECT_EQ(voxels_from<float>("<f4", 0.5, {NAN, 0.5F, 0.49999997F, inf, -inf, 1}), "010101");
  EXPECT_EQ(voxels_from<float>("<f4", 0, {NAN, 0, -0.0F, -1e-45F, -inf, 1e-45F}), "011001");
  EXPECT_EQ(voxels_from<float>("<f4", -1e30, {NAN, 0, -inf}), "010");
  EXPECT_EQ(voxels_from<double>("<f8", 0.1, {NAN, 0.1, 0.09999999999999999}), "010");
  // Halves: 1, 1.001, 65504, infinity, NaN, the least number above 0, -2.
  const std::vector<uint16_t> halves = {0x3c00, 0x3c01, 0x7bff, 0x7c00, 0x7e00, 0x0001, 0xc000};
  EXPECT_EQ(voxels_from<uint16_t>("<f2", 1, halves), "1111000");
  EXPECT_EQ(voxels_from<uint16_t>("<f2", 1.0005, halves), "0111000");
  EXPECT_EQ(voxels_from<uint16_t>("<f2", 65504, halves), "0011000");
  EXPECT_EQ(voxels_from<uint16_t>("<f2", 0x1p-24, halves), "1111010");
  EXPECT_EQ(voxels_from<uint16_t>("<f2", -2, halves), "1111011");
}

TEST(NpyVolume, colors_are_voxels_by_alpha_or_by_any_component) {
  const Bytes four = {1, 2, 3, 0, 0, 0, 0, 255, 9, 8, 7, 6};
  EXPECT_EQ(colors_of(loaded(npy(dictionary("|u1", false, "(1, 1, 3, 4)"), four), 100)),
            (Colors{{{1, 0, 0}, {0, 0, 0, 255}}, {{2, 0, 0}, {9, 8, 7, 6}}}));
  const Bytes three = {0, 0, 0, 0, 0, 1, 9, 8, 7};
  EXPECT_EQ(colors_of(loaded(npy(dictionary("|u1", false, "(3, 1, 1, 3)"), three), 100)),
            (Colors{{{0, 0, 1}, {0, 0, 1, 255}}, {{0, 0, 2}, {9, 8, 7, 255}}}));
  for (const bool is_big_endian : {false, true}) {
    Bytes floats;
    for (const float value : {1.0F, 0.0F, 0.2158605F, 1e-9F, 7.0F, -1.0F, NAN, 1.0F,  //
                              1.0F, 1.0F, 1.0F, 0.0F, 1.0F, 1.0F, 1.0F, NAN}) {
      append(floats, value, is_big_endian);
    }
    const std::string descr = is_big_endian ? ">f4" : "<f4";
    EXPECT_EQ(colors_of(loaded(npy(dictionary(descr, false, "(1, 1, 4, 4)"), floats))),
              (Colors{{{0, 0, 0}, {255, 0, 128, 1}}, {{1, 0, 0}, {255, 0, 0, 255}}}));
  }
}

TEST(NpyVolume, broken_files_say_what_is_wrong) {
  const Bytes eight(8, 1);
  const auto u1 = [&](const std::string& shape) {
    return npy(dictionary("|u1", false, shape), eight);
  };
  const std::pair<Bytes, std::string> kTable[] = {
      {bytes_of("\x93NUMPY"),
       "a.npy: byte 0: not an array: expected the magic \\x93NUMPY and a version, got other bytes"},
      {npy("{}", {}, 4), "a.npy: byte 6: version: expected 1.0, 2.0 or 3.0, got 4.0"},
      {bytes_of("\x93NUMPY\x01\x01zz"),
       "a.npy: byte 6: version: expected 1.0, 2.0 or 3.0, got 1.1"},
      {bytes_of(std::string("\x93NUMPY\x02\x00\x01\x00", 10)),
       "a.npy: byte 8: the file ends: expected the length of the header"},
      {bytes_of(std::string("\x93NUMPY\x01\x00\x09\x00{}", 12)),
       "a.npy: byte 8: the header is longer than the file: expected at most 2 bytes, got 9"},
      {bytes_of(std::string("\x93NUMPY\x03\x00\xff\xff\xff\xff{}", 14)),
       "a.npy: byte 8: the header is longer than the file: expected at most 2 bytes, got "
       "4294967295"},
      {npy("[]", eight), R"(a.npy: header: character 0: expected '{', got "[]")"},
      {npy("{'descr' '|u1'}", eight), R"(a.npy: header: character 9: expected ':', got "'|u1'}")"},
      {npy("{'descr': '|u1", eight),
       R"(a.npy: header: character 10: expected a type in quotes, got "'|u1")"},
      {npy("{'descr': '|u1'", eight),
       "a.npy: header: character 15: expected ',' or '}', got the end of the header"},
      {npy("{'fortran_order': 1}", eight),
       R"(a.npy: header: character 18: expected True or False, got "1}")"},
      {npy("{'shape': [2]}", eight), R"(a.npy: header: character 10: expected '(', got "[2]}")"},
      {npy("{'shape': (2, -2)}", eight),
       R"(a.npy: header: character 14: expected the side of an axis or ')', got "-2)}")"},
      {npy("{'shape': (99999999999999999999,)}", eight),
       R"(a.npy: header: character 11: expected the side of an axis or ')', got "99999999")"},
      {npy("{'shape': (2, 2), 'shape': (2, 2)}", eight),
       R"(a.npy: header: a key is there twice: got "shape")"},
      {npy("{'order': 'C'}", eight),
       R"(a.npy: header: unknown key: expected descr, fortran_order or shape, got "order")"},
      {npy("{'descr': '|u1', 'shape': (2, 2, 2)}", eight),
       "a.npy: header: a key is missing: expected descr, fortran_order and shape, got descr shape"},
      {npy("{} x", eight),
       R"(a.npy: header: character 3: expected the end of the header, got "x")"},
      {npy("{'descr': [('a', '<f4')]}", eight),
       "a.npy: descr: records: expected numbers, such as '<f4', got a list of fields"},
      {npy(dictionary("<c8", false, "(1, 1, 1)"), eight),
       "a.npy: descr: the type of samples: expected |b1, |u1, |i1, or <u2, <i2, <f2, ... <u8, <i8, "
       "<f8, or > for <, got \"<c8\""},
      {npy(dictionary("|u2", false, "(1, 2, 2)"), eight),
       "a.npy: descr: the type of samples: expected |b1, |u1, |i1, or <u2, <i2, <f2, ... <u8, <i8, "
       "<f8, or > for <, got \"|u2\""},
      {u1("(8,)"),
       "a.npy: shape: the axes of the array: expected (z, y, x), or (z, y, x, 3 or 4) "
       "for colours, got (8)"},
      {u1("(2, 4)"),
       "a.npy: shape: the axes of the array: expected (z, y, x), or (z, y, x, 3 or 4)"
       " for colours, got (2, 4)"},
      {u1("(2, 2, 1, 2)"),
       "a.npy: shape: the axes of the array: expected (z, y, x), or (z, y, x, 3"
       " or 4) for colours, got (2, 2, 1, 2)"},
      {u1("(2, 1, 1, 1, 4)"),
       "a.npy: shape: the axes of the array: expected (z, y, x), or (z, y, x"
       ", 3 or 4) for colours, got (2, 1, 1, 1, 4)"},
      {u1("(2, 0, 4)"),
       "a.npy: shape: an array without samples: expected sides from 1 on, got (2, 0, 4)"},
      {u1("(2, 1, 16385)"),
       "a.npy: too many cells on a side: expected at most 16384, got 16385 x 1 x 2"},
      {u1("(18446744073709551615, 1, 1)"),
       "a.npy: too many cells on a side: expected at most 16384,"
       " got 1 x 1 x 9223372036854775807"},
      {npy(dictionary("|b1", false, "(1, 1, 2, 4)"), eight),
       R"(a.npy: descr: the type of colours: expected |u1, <f4 or >f4, got "|b1")"},
      {u1("(2, 2, 3)"),
       "a.npy: data: the samples are not those of the shape: expected 12 bytes, got 8"},
      {u1("(1, 2, 3)"),
       "a.npy: data: the samples are not those of the shape: expected 6 bytes, got 8"},
      {npy(dictionary("<f8", false, "(16384, 16384, 16384, 4)"), eight),
       R"(a.npy: descr: the type of colours: expected |u1, <f4 or >f4, got "<f8")"},
      {npy(dictionary("<f4", false, "(16384, 16384, 16384, 4)"), eight),
       "a.npy: data: the samples are not those of the shape: expected 70368744177664 bytes, got 8"},
  };
  for (const auto& [bytes, message] : kTable) {
    EXPECT_EQ(error_of(read_npy("a.npy", bytes, 0.5)), message);
  }
}

TEST(NpyVolume, every_truncation_is_refused) {
  expect_truncations_fail(npy(dictionary("<u2", false, "(1, 2, 3)"), Bytes(12, 1)),
                          [](std::span<const uint8_t> bytes) { return read_npy("a", bytes, 0.5); });
}

// nrrd

Bytes joined(const std::string& header, const Bytes& samples) {
  Bytes bytes = bytes_of(header);
  bytes.insert(bytes.end(), samples.begin(), samples.end());
  return bytes;
}

Bytes gzip(const Bytes& bytes) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 1, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY), Z_OK);
  Bytes out(deflateBound(&stream, bytes.size()));
  stream.next_in = const_cast<uint8_t*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = out.data();
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

TEST(NrrdVolume, what_the_encoder_writes_reads_back) {
  const Grid grid = large_grid();
  for (const DType dtype : {DType::kBool, DType::kUint8, DType::kFloat32}) {
    OutputOptions options = to(Format::kNrrd);
    options.dtype = dtype;
    const Grid read = loaded(encoded(grid, options));
    EXPECT_EQ(read.tiles, occupancy(grid));
    expect_place(read.spec, grid.spec);
  }
}

TEST(NrrdVolume, colors_that_the_encoder_writes_read_back) {
  const Grid grid = large_grid({.color = true});
  for (const DType dtype : {DType::kUint8, DType::kFloat32}) {
    OutputOptions options = to(Format::kNrrd);
    options.dtype = dtype;
    options.channel = Channel::kColor;
    const Grid read = loaded(encoded(grid, options));
    EXPECT_TRUE(read.tiles == grid.tiles);
    EXPECT_TRUE(read.channels == grid.channels);
    expect_place(read.spec, grid.spec);
  }
}

// kValues in C order have x fastest.
Bytes values_u1() {
  return value_bytes(false,
                     [](Bytes& out, int value) { out.push_back(static_cast<uint8_t>(value)); });
}
const std::string kNrrdStart = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 5 2 3\n";

TEST(NrrdVolume, a_small_file_has_its_cells_in_its_place) {
  const std::string header =
      "NRRD0005\n# a comment\nType: unsigned char\nkey:=value: with a colon\nspace dimension: 3\n"
      "a: b:=c\ndimension: 3\nsizes: 5 2 3\nspacedirections: (2,0,0) (0, 3 ,0) (1e-9,0,0.5)\n"
      "space origin: (10,20,30)\ncenters: node node node\nkinds: domain domain domain\n"
      "measurement frame: (1,0,0) (0,1,0) (0,0,1)\ncontent: a thing\nencoding: raw\n\n";
  for (const bool is_crlf : {false, true}) {
    std::string text;
    for (const char c : header) text += c == '\n' && is_crlf ? "\r\n" : std::string(1, c);
    const Grid grid = loaded(joined(text, values_u1()), 3);
    EXPECT_EQ(cells_of(grid), kCellsFrom3);
    expect_place(grid.spec, {{5, 2, 3}, {9, 18.5, 29.75}, {2, 3, 0.5}});
  }
}

TEST(NrrdVolume, negative_directions_mirror_the_cells) {
  for (const bool is_gzip : {false, true}) {
    const Bytes data = is_gzip ? gzip(values_u1()) : values_u1();
    for (uint32_t mirrored = 0; mirrored < 8; ++mirrored) {
      const auto sign = [&](int axis) { return (mirrored >> axis & 1) != 0 ? -1 : 1; };
      const std::string header =
          kNrrdStart + "space: right-anterior-superior\nspace directions: (" +
          std::to_string(2 * sign(0)) + ",0,0) (0," + std::to_string(3 * sign(1)) + ",0) (0,0," +
          std::to_string(4 * sign(2)) +
          ")\nspace origin: (10,20,30)\nencoding: " + (is_gzip ? "gzip" : "raw") + "\n\n";
      const Grid grid = loaded(joined(header, data), 3);
      std::set<std::array<double, 3>> centers, expected;
      for (const auto& [x, y, z] : cells_of(grid)) {
        const glm::dvec3 p = grid.spec.world_from_grid(glm::dvec3(x, y, z) + 0.5);
        centers.insert({p.x, p.y, p.z});
      }
      for (const auto& [x, y, z] : kCellsFrom3) {
        expected.insert({10.0 + 2 * sign(0) * x, 20.0 + 3 * sign(1) * y, 30.0 + 4 * sign(2) * z});
      }
      EXPECT_EQ(centers, expected) << mirrored;
    }
  }
}

TEST(NrrdVolume, mirrored_colors_and_long_rows_keep_their_places) {
  const Grid grid = large_grid({.color = true});
  OutputOptions options = to(Format::kNrrd);
  options.channel = Channel::kColor;
  const Bytes bytes = encoded(grid, options);
  std::string text(bytes.begin(), bytes.end());
  const std::string directions = "(0.5,0,0) (0,0.25,0) (0,0,0.125)";
  const size_t at = text.find(directions);
  ASSERT_NE(at, std::string::npos);
  text.replace(at, directions.size(), "(0,-1,0) (0,0,-1) (-1,0,0)");
  const Grid read = loaded(bytes_of(text));
  EXPECT_EQ(read.spec.dims, glm::ivec3(37, 600, 301));
  Colors expected;
  for (const auto& [cell, color] : colors_of(grid)) {
    expected[{36 - cell[2], 599 - cell[0], 300 - cell[1]}] = color;
  }
  EXPECT_TRUE(colors_of(read) == expected);
}

TEST(NrrdVolume, axes_may_be_in_any_order) {
  const std::string header = kNrrdStart +
                             "space: 3D-left-handed\nspace directions: (0,0,2) (3,0,0) (0,-4,0)\n"
                             "space origin: (10,20,30)\nencoding: raw\n\n";
  const Grid grid = loaded(joined(header, values_u1()), 3);
  Cells expected;
  for (const auto& [x, y, z] : kCellsFrom3) expected.insert({y, 2 - z, x});
  EXPECT_EQ(cells_of(grid), expected);
  expect_place(grid.spec, {{2, 3, 5}, {8.5, 10, 29}, {3, 4, 2}});
}

TEST(NrrdVolume, spacings_are_edges_of_voxels) {
  const auto spec = [](const std::string& field) {
    return loaded(joined(kNrrdStart + field + "encoding: raw\n\n", values_u1())).spec;
  };
  expect_place(spec("spacings: 2 0.5 NaN\n"), {{5, 2, 3}, glm::dvec3(0), {2, 0.5, 1}});
  expect_place(spec("spacings: 2 2 +2\nspace origin: (1,1,1)\n"),
               {{5, 2, 3}, glm::dvec3(0), glm::dvec3(2)});
  expect_place(spec(""), {{5, 2, 3}, glm::dvec3(0), glm::dvec3(1)});
}

TEST(NrrdVolume, types_of_every_spelling_read) {
  const std::pair<std::string, size_t> kTypes[] = {{"signed char", 1},
                                                   {"int8", 1},
                                                   {"int8_t", 1},
                                                   {"uchar", 1},
                                                   {"unsigned char", 1},
                                                   {"uint8", 1},
                                                   {"uint8_t", 1},
                                                   {"short", 2},
                                                   {"short int", 2},
                                                   {"signed short", 2},
                                                   {"signed short int", 2},
                                                   {"int16", 2},
                                                   {"int16_t", 2},
                                                   {"ushort", 2},
                                                   {"unsigned short", 2},
                                                   {"unsigned short int", 2},
                                                   {"uint16", 2},
                                                   {"uint16_t", 2},
                                                   {"int", 4},
                                                   {"signed int", 4},
                                                   {"int32", 4},
                                                   {"int32_t", 4},
                                                   {"uint", 4},
                                                   {"unsigned int", 4},
                                                   {"uint32", 4},
                                                   {"uint32_t", 4},
                                                   {"longlong", 8},
                                                   {"long long", 8},
                                                   {"long long int", 8},
                                                   {"signed long long", 8},
                                                   {"signed long long int", 8},
                                                   {"int64", 8},
                                                   {"int64_t", 8},
                                                   {"ulonglong", 8},
                                                   {"unsigned long long", 8},
                                                   {"unsigned long long int", 8},
                                                   {"uint64", 8},
                                                   {"uint64_t", 8}};
  for (const auto& [word, size] : kTypes) {
    for (const bool is_big_endian : {false, true}) {
      Bytes data(3 * size);
      data[size + (is_big_endian ? size - 1 : 0)] = 5;
      const Grid grid =
          loaded(joined("NRRD0001\ntype: " + word + "\ndimension: 3\nsizes: 1 3 1\n" +
                            "endian: " + (is_big_endian ? "big" : "little") + "\nencoding: raw\n\n",
                        data),
                 5);
      EXPECT_EQ(cells_of(grid), (Cells{{0, 1, 0}})) << word;
    }
  }
  for (const bool is_double : {false, true}) {
    Bytes data;
    for (const double value : {0.1, 0.7}) {
      is_double ? append(data, value, true) : append(data, static_cast<float>(value), true);
    }
    const std::string header = std::string("NRRD0001\nencoding: raw\nendian: BIG\ntype: ") +
                               (is_double ? "double" : "float") +
                               "\nsizes: 2 1 1\ndimension: 3\n\n";
    EXPECT_EQ(cells_of(loaded(joined(header, data))), (Cells{{1, 0, 0}}));
  }
}

TEST(NrrdVolume, the_first_of_four_axes_is_a_color) {
  const Bytes data = {1, 2, 3, 0, 0, 0, 0, 0, 4};
  for (const std::string kinds :
       {"", "kinds: RGB-color domain domain domain\n", "kinds: ??? space space space\n",
        "kinds: list none none none\n"}) {
    const std::string header = "NRRD0003\ntype: uchar\ndimension: 4\nsizes: 3 1 3 1\n" + kinds +
                               "space directions: none (1,0,0) (0,1,0) (0,0,1)\n"
                               "encoding: gz\n\n";
    EXPECT_EQ(colors_of(loaded(joined(header, gzip(data)))),
              (Colors{{{0, 0, 0}, {1, 2, 3, 255}}, {{0, 2, 0}, {0, 0, 4, 255}}}));
  }
}

TEST(NrrdVolume, gzip_may_have_several_members) {
  const Bytes values = values_u1();
  Bytes data = gzip({values.begin(), values.begin() + 13});
  const Bytes rest = gzip({values.begin() + 13, values.end()});
  data.insert(data.end(), rest.begin(), rest.end());
  EXPECT_EQ(cells_of(loaded(joined(kNrrdStart + "encoding: gzip\n\n", data), 3)), kCellsFrom3);
}

TEST(NrrdVolume, each_member_of_gzip_has_a_cancellation_point) {
  constexpr int kMembers = 1000;
  const Bytes none = gzip({}), values = gzip(values_u1());
  Bytes data;
  for (int i = 0; i < kMembers; ++i) data.insert(data.end(), none.begin(), none.end());
  data.insert(data.end(), values.begin(), values.end());
  const Bytes file = joined(kNrrdStart + "encoding: gzip\n\n", data);
  EXPECT_GE(test::points_passed([&] { EXPECT_EQ(cells_of(loaded(file, 3)), kCellsFrom3); }),
            kMembers);
}

TEST(NrrdVolume, broken_files_say_what_is_wrong) {
  const Bytes values = values_u1();
  const auto file = [&](const std::string& fields) {
    return joined(kNrrdStart + fields + "\n", values);
  };
  const auto start = [&](const std::string& fields) {
    return joined("NRRD0004\n" + fields + "\n", values);
  };
  const std::string raw = "encoding: raw\n";
  const std::string u1 = "type: uint8\n" + raw;
  const std::pair<Bytes, std::string> kTable[] = {
      {bytes_of("NRRD0004"), "a.nrrd: line 1: the file ends: expected NRRD0001 to NRRD0005"},
      {bytes_of("NRRD0006\n"),
       R"(a.nrrd: line 1: version: expected NRRD0001 to NRRD0005, got "NRRD0006")"},
      {bytes_of("NRRD0004\ntype: uint8\n"),
       "a.nrrd: header: the file ends: expected an empty line and the samples"},
      {file("encoding\n"),
       R"(a.nrrd: line 5: neither a field nor a key: expected "field: value", got "encoding")"},
      {file("spacing: 1\n"),
       R"(a.nrrd: line 5: unknown field: expected a field of NRRD, got "spacing")"},
      {file("encoding: raw\n# one\nencoding: raw\n"),
       R"(a.nrrd: line 7: the field is there twice: got "encoding")"},
      {file("data file: a.raw\n"),
       "a.nrrd: data file: samples in another file: expected samples after "
       "the header, got \"a.raw\""},
      {file("datafile: LIST\n"),
       "a.nrrd: data file: samples in another file: expected samples after "
       "the header, got \"LIST\""},
      {start(raw),
       "a.nrrd: type: the type of samples: expected int8, uint8, ... uint64, float, "
       "double, got no such field"},
      {start("type: char\n"),
       "a.nrrd: type: the type of samples: expected int8, uint8, ... uint64, "
       "float, double, got \"char\""},
      {start("type: block\n"), R"(a.nrrd: type: opaque blocks: expected numbers, got "block")"},
      {start("type: short\n" + raw),
       "a.nrrd: endian: the order of bytes: expected little or big, got no such field"},
      {start("type: uint8\n"),
       "a.nrrd: encoding: the encoding: expected raw or gzip, got no such field"},
      {file("encoding: ascii\n"),
       R"(a.nrrd: encoding: the encoding: expected raw or gzip, got "ascii")"},
      {file("encoding: bzip2\n"),
       R"(a.nrrd: encoding: the encoding: expected raw or gzip, got "bzip2")"},
      {file("encoding: rar\n"),
       R"(a.nrrd: encoding: the encoding: expected raw or gzip, got "rar")"},
      {file(raw + "byte skip: -1\n"),
       R"(a.nrrd: byte skip: bytes before the samples: expected 0, got "-1")"},
      {file(raw + "line skip: 2\n"),
       R"(a.nrrd: line skip: bytes before the samples: expected 0, got "2")"},
      {start(u1),
       "a.nrrd: dimension: the number of axes: expected a number from 1 on, got no such field"},
      {start(u1 + "dimension: 2\n"),
       R"(a.nrrd: dimension: the number of axes: expected 3, or 4 for colours, got "2")"},
      {start(u1 + "dimension: 3\nsizes: 5 6\n"),
       R"(a.nrrd: sizes: cells of the axes: expected 3 numbers, got "5 6")"},
      {start(u1 + "dimension: 3\nsizes: 5 0 6\n"),
       R"(a.nrrd: sizes: cells of an axis: expected numbers from 1 on, got "5 0 6")"},
      {start(u1 + "dimension: 3\nsizes: 5 16385 6\n"),
       "a.nrrd: too many cells on a side: expected at most 16384, got 5 x 16385 x 6"},
      {start(u1 + "dimension: 4\nsizes: 2 5 6 7\n"),
       "a.nrrd: sizes: the first of four axes: expected 3 or 4 components of "
       "a colour, got \"2 5 6 7\""},
      {start(raw + "type: int8\ndimension: 4\nsizes: 3 5 6 7\n"),
       R"(a.nrrd: type: the type of colours: expected uint8 or float, got "int8")"},
      {start(u1 + "dimension: 4\nsizes: 3 5 6 7\nkinds: 3-normal domain domain domain\n"),
       "a.nrrd: kinds: the first of four axes: expected RGB-color or RGBA-color, got \"3-normal "
       "domain domain domain\""},
      {start(u1 + "dimension: 4\nsizes: 3 5 6 7\nkinds: RGBA-color none none none\n"),
       "a.nrrd: kinds: the first axis has another size: expected RGB-color, got \"RGBA-color none "
       "none none\""},
      {file(raw + "kinds: domain\n"),
       R"(a.nrrd: kinds: kinds of the axes: expected 3 words, got "domain")"},
      {file(raw + "kinds: RGB-color domain domain\n"),
       "a.nrrd: kinds: components of an image of two axes: expected three axes beside them, got "
       "\"RGB-color domain domain\""},
      {file(raw + "kinds: space space 3-vector\n"),
       "a.nrrd: kinds: components of an image of two axes: expected three axes beside them, got "
       "\"space space 3-vector\""},
      {file(raw + "spacings: 1 1\n"),
       R"(a.nrrd: spacings: edges of a voxel: expected 3 numbers, got "1 1")"},
      {file(raw + "spacings: 1 1 inf\n"),
       R"(a.nrrd: spacings: edges of a voxel: expected numbers of at most 1e30, got "1 1 inf")"},
      {file(raw + "spacings: 1 1 0\n"),
       R"(a.nrrd: spacings: a voxel without an edge: expected edges above 1e-30, got "1 1 0")"},
      {file(raw + "space directions: (1,0,0) (0,1,0)\n"),
       "a.nrrd: space directions: directions of the axes: expected 3 vectors of 3 numbers, got "
       "\"(1,0,0) (0,1,0)\""},
      {file(raw + "space directions: (1,0) (0,1) (0,0)\n"),
       "a.nrrd: space directions: directions of the axes: expected 3 vectors of 3 numbers, got "
       "\"(1,0) (0,1) (0,0)\""},
      {file(raw + "space directions: none none none\n"),
       "a.nrrd: space directions: directions of the axes: expected 3 vectors of 3 numbers, got "
       "\"none none none\""},
      {file(raw + "space directions: (1,0.1,0) (0,1,0) (0,0,1)\n"),
       "a.nrrd: space directions: axes that are rotated: expected one axis of the world for each, "
       "got \"(1,0.1,0) (0,1,0) (0,0,1)\""},
      {file(raw + "space directions: (1,0,0) (1,0,0) (0,0,1)\n"),
       "a.nrrd: space directions: axes that are rotated: expected one axis of the world for each, "
       "got \"(1,0,0) (1,0,0) (0,0,1)\""},
      {file(raw + "space origin: (1,0,nan)\n"),
       "a.nrrd: space origin: the place of the first sample: expected a vector of 3 numbers, got "
       "\"(1,0,nan)\""},
      {joined(kNrrdStart + raw + "\n", Bytes(29)),
       "a.nrrd: data: the samples are not those of the sizes: expected 30 bytes, got 29"},
      {joined(kNrrdStart + raw + "\n", Bytes(31)),
       "a.nrrd: data: the samples are not those of the sizes: expected 30 bytes, got 31"},
      {file("encoding: gzip\n"), "a.nrrd: data: no whole gzip stream: got incorrect header check"},
      {joined(kNrrdStart + "encoding: gzip\n\n", gzip(Bytes(29))),
       "a.nrrd: data: the samples are not those of the sizes: expected 30 bytes, got 29"},
      {joined(kNrrdStart + "encoding: gzip\n\n", gzip(Bytes(31))),
       "a.nrrd: data: the samples are not those of the sizes: expected 30 bytes, got more"},
      {joined(kNrrdStart + "encoding: gzip\n\n", {}),
       "a.nrrd: data: no whole gzip stream: got it ends early"},
      {start("type: uint8\nencoding: gzip\ndimension: 3\nsizes: 1000 1000 1000\n"),
       "a.nrrd: data: the samples are not those of the sizes: expected 1000000000 bytes, got 30 in "
       "gzip, which hold fewer"},
      {start("type: uint8\nencoding: gzip\ndimension: 3\nsizes: 16384 16384 16384\n"),
       "a.nrrd: too many samples in gzip: expected at most 34359738368 bytes, got 4398046511104"},
  };
  for (const auto& [bytes, message] : kTable) {
    EXPECT_EQ(error_of(read_nrrd("a.nrrd", bytes, 0.5)), message);
  }
}

TEST(NrrdVolume, every_truncation_is_refused) {
  const auto read = [](std::span<const uint8_t> bytes) { return read_nrrd("a", bytes, 0.5); };
  expect_truncations_fail(joined(kNrrdStart + "encoding: raw\n\n", values_u1()), read);
  expect_truncations_fail(joined(kNrrdStart + "encoding: gzip\n\n", gzip(values_u1())), read);
}

TEST(NrrdVolume, more_voxels_than_a_grid_may_have_are_refused) {
  const Bytes data = gzip(Bytes(size_t{1024} * 1024 * 257, 1));
  EXPECT_EQ(error_of(read_nrrd("a.nrrd",
                               joined("NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1024 1024 257\n"
                                      "encoding: gzip\n\n",
                                      data),
                               1)),
            "a.nrrd: too many voxels: expected at most 268435456, got 268436480");
}

// voxg

TEST(ContainerVolume, a_broken_file_is_named_and_malformed) {
  Bytes bytes = encoded(large_grid(), to(Format::kNative));
  EXPECT_EQ(loaded(bytes).tiles, occupancy(large_grid()));
  const size_t size = bytes.size();
  bytes.pop_back();
  const auto volume = load_volume("a.voxg", bytes, 0.5);
  ASSERT_FALSE(volume);
  EXPECT_EQ(volume.error().code, ErrorCode::kMalformedMesh);
  EXPECT_EQ(error_of(volume), "a.voxg: grid container, byte 96: length: expected " +
                                  std::to_string(size) + " bytes, got " + std::to_string(size - 1));
}

TEST(ContainerVolume, a_place_that_floats_do_not_hold_is_refused) {
  const auto error_at = [](double origin, double voxel_size) {
    Grid grid = test::grid_of({2, 2, 2}, test::box_voxels({0, 0, 0}, {1, 1, 1}), {});
    grid.spec.origin_world.y = origin;
    grid.spec.voxel_size.z = voxel_size;
    return error_of(load_volume("a.voxg", encoded(grid, to(Format::kNative)), 0.5));
  };
  EXPECT_EQ(error_at(-1e30, 1e30), "no error");
  EXPECT_EQ(error_at(0, 1e-30), "no error");
  EXPECT_EQ(error_at(-1e300, 1),
            "a.voxg: origin: corner of the grid: expected 3 numbers of at most 1e30, got -1e+300");
  EXPECT_EQ(error_at(0, 1e299),
            "a.voxg: voxel size: edges of a voxel: expected numbers from 1e-30 to 1e30, got "
            "1e+299");
  EXPECT_EQ(error_at(0, 1e-200),
            "a.voxg: voxel size: edges of a voxel: expected numbers from 1e-30 to 1e30, got "
            "1e-200");
}

// Containers of some 100 bytes for each tile of 16 million voxels.
TEST(ContainerVolume, more_voxels_than_a_grid_may_have_are_refused_but_full_bricks_cost_little) {
  constexpr int kTiles = 17;
  constexpr uint32_t kTileBricks = 32 * 32 * 32;
  const auto container = [](SparseTile tile) {
    Grid grid;
    grid.spec.dims = {kTiles * limits::kTileSide, limits::kTileSide, limits::kTileSide};
    for (; tile.coord[0] < kTiles; ++tile.coord[0]) grid.tiles.push_back(tile);
    return encoded(grid, to(Format::kNative));
  };
  SparseTile full;
  full.full.push_back({0, kTileLevels});
  EXPECT_EQ(loaded(container(full)).voxel_count(), uint64_t{kTiles} << 24);

  SparseTile with_holes;
  for (uint32_t i = 0; i < kTileBricks; ++i) {
    with_holes.brick_morton.push_back(i);
    with_holes.masks.emplace_back().words.fill(~uint64_t{0});
    with_holes.masks.back().words[0] ^= 1;
  }
  const auto volume = load_volume("a.voxg", container(with_holes), 0.5);
  ASSERT_FALSE(volume);
  EXPECT_EQ(volume.error().code, ErrorCode::kGridTooLarge);
  EXPECT_EQ(error_of(volume), "a.voxg: too many voxels: expected at most 268435456, got 284655616");
}

}  // namespace
}  // namespace voxeld
