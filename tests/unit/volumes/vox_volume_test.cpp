// MagicaVoxel files: those of the encoder read back, files made by hand from the specification,
// and broken ones.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include "server/formats/formats.h"
#include "server/volumes/volume.h"
#include "tests/unit/base/points_passed.h"
#include "tests/unit/formats/sample_frames.h"

namespace voxeld::vox_volume_test {
namespace {

using Bytes = std::vector<uint8_t>;
using Cell = std::array<int, 3>;
using Color = std::array<uint8_t, 4>;
using Cells = std::map<Cell, Color>;
using Dict = std::vector<std::pair<std::string, std::string>>;

// Writes the parts of a file as the specification says.
struct Vox {
  Bytes bytes;

  Vox& i32(int64_t value) {
    for (int shift = 0; shift < 32; shift += 8) {
      bytes.push_back(static_cast<uint8_t>(value >> shift));
    }
    return *this;
  }
  Vox& raw(const Bytes& more) {
    bytes.insert(bytes.end(), more.begin(), more.end());
    return *this;
  }
  Vox& raw(std::string_view text) { return raw(Bytes(text.begin(), text.end())); }
  Vox& text(std::string_view text) { return i32(static_cast<int64_t>(text.size())).raw(text); }
  Vox& dict(const Dict& pairs) {
    i32(static_cast<int64_t>(pairs.size()));
    for (const auto& [key, value] : pairs) text(key).text(value);
    return *this;
  }
};

Bytes chunk(std::string_view id, const Vox& content, const Bytes& children = {}) {
  return Vox()
      .raw(id)
      .i32(static_cast<int64_t>(content.bytes.size()))
      .i32(static_cast<int64_t>(children.size()))
      .raw(content.bytes)
      .raw(children)
      .bytes;
}
Bytes file(const std::vector<Bytes>& chunks, int version = 150) {
  Bytes all;
  for (const Bytes& part : chunks) all.insert(all.end(), part.begin(), part.end());
  return Vox().raw("VOX ").i32(version).raw(chunk("MAIN", {}, all)).bytes;
}
Bytes size_chunk(const Cell& size) {
  return chunk("SIZE", Vox().i32(size[0]).i32(size[1]).i32(size[2]));
}
// Voxels: x, y, z, number of the colour.
Bytes model(const Cell& size, const std::vector<Color>& voxels) {
  Vox xyzi;
  xyzi.i32(static_cast<int64_t>(voxels.size()));
  for (const Color& voxel : voxels) xyzi.raw(Bytes(voxel.begin(), voxel.end()));
  Bytes both = size_chunk(size);
  const Bytes voxel_chunk = chunk("XYZI", xyzi);
  both.insert(both.end(), voxel_chunk.begin(), voxel_chunk.end());
  return both;
}
Bytes transform(int id, int child, const Dict& frame = {}, const Dict& attributes = {},
                int layer = -1) {
  return chunk("nTRN",
               Vox().i32(id).dict(attributes).i32(child).i32(-1).i32(layer).i32(1).dict(frame));
}
Bytes group(int id, const std::vector<int>& children, const Dict& attributes = {}) {
  Vox content;
  content.i32(id).dict(attributes).i32(static_cast<int64_t>(children.size()));
  for (const int child : children) content.i32(child);
  return chunk("nGRP", content);
}
Bytes shape(int id, int model, const Dict& attributes = {}) {
  return chunk("nSHP", Vox().i32(id).dict(attributes).i32(1).i32(model).dict({}));
}
Bytes palette(const std::vector<Color>& colors) {
  Vox content;
  for (size_t i = 0; i < 256; ++i) {
    const Color color = i < colors.size() ? colors[i] : Color{};
    content.raw(Bytes(color.begin(), color.end()));
  }
  return chunk("RGBA", content);
}

Volume read(const Bytes& bytes) {
  auto volume = load_volume("a.vox", bytes, 0);
  EXPECT_TRUE(volume) << (volume ? "" : volume.error().message());
  return volume ? *std::move(volume) : Volume();
}
std::string error_of(const Bytes& bytes) {
  const auto volume = load_volume("a.vox", bytes, 0);
  return volume ? "no error" : volume.error().message();
}
Cells cells_of(const Grid& grid) {
  EXPECT_EQ(grid.channels, (ChannelSet{.color = true}));
  Cells cells;
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      const uint8_t* c = &tile.color.at(4 * voxel);
      cells[{x, y, z}] = {c[0], c[1], c[2], c[3]};
    });
  }
  return cells;
}
Cells cells_in(const Bytes& bytes) {
  return cells_of(read(bytes).grid);
}
Cell dims_of(const Volume& volume) {
  const auto& dims = volume.grid.spec.dims;
  return {dims.x, dims.y, dims.z};
}
std::vector<std::string> warnings_of(const Volume& volume) {
  std::vector<std::string> texts;
  for (const Warning& warning : volume.warnings) {
    texts.push_back(warning.code + ": " + warning.detail);
  }
  return texts;
}

// At most 255 opaque colours, so that a palette holds them exactly.
Grid opaque_grid(uint32_t seed, const Cell& dims, int voxels) {
  Grid grid = test::random_grid(seed, dims, voxels, true, false);
  for (SparseTile& tile : grid.tiles) {
    for (size_t i = 0; i < tile.color.size(); i += 4) {
      const int entry = tile.color[i] % 255;
      tile.color[i] = static_cast<uint8_t>(entry);
      tile.color[i + 1] = static_cast<uint8_t>(3 * entry);
      tile.color[i + 2] = static_cast<uint8_t>(255 - entry);
      tile.color[i + 3] = 255;
    }
  }
  return grid;
}
void expect_same_place(const Grid& grid, const Grid& expected) {
  EXPECT_EQ(grid.spec.dims, expected.spec.dims);
  EXPECT_EQ(grid.spec.origin_world, expected.spec.origin_world);
  EXPECT_EQ(grid.spec.voxel_size, expected.spec.voxel_size);
}

TEST(VoxVolume, a_written_grid_reads_back_as_the_same_cells_colours_and_place) {
  for (const Cell dims : {Cell{1, 1, 1}, Cell{7, 8, 9}, Cell{20, 31, 42}, Cell{255, 256, 257},
                          Cell{601, 270, 300}, Cell{16384, 3, 1025}}) {
    const Grid grid = opaque_grid(static_cast<uint32_t>(dims[0]), dims, 2000);
    const auto bytes = encode(grid, test::to(Format::kVox));
    ASSERT_TRUE(bytes);
    const Volume volume = read(*bytes);
    expect_same_place(volume.grid, grid);
    EXPECT_TRUE(volume.grid.tiles == grid.tiles) << dims[0];
    EXPECT_EQ(volume.grid.channels, grid.channels);
    EXPECT_TRUE(volume.warnings.empty());
  }
}

TEST(VoxVolume, a_written_grid_without_voxels_and_one_with_full_nodes_read_back) {
  const Grid empty = test::grid_of({300, 20, 31}, {}, true, false);
  const Volume none = read(*encode(empty, test::to(Format::kVox)));
  expect_same_place(none.grid, empty);
  EXPECT_TRUE(none.grid.tiles.empty());

  const Grid solid = test::grid_with_a_full_brick(true, false);
  const Volume volume = read(*encode(solid, test::to(Format::kVox)));
  expect_same_place(volume.grid, solid);
  const Cells cells = cells_of(volume.grid);
  EXPECT_EQ(cells.size(), 513u);
  EXPECT_EQ(cells.at({0, 0, 0}), (Color{10, 20, 30, 255}));
  EXPECT_EQ(cells.at({15, 8, 9}), (Color{10, 20, 30, 255}));  // the mean colour
}

TEST(VoxVolume, of_a_written_sequence_the_first_frame_is_read) {
  const Cell dims = {300, 40, 50};
  std::vector<Grid> frames = {opaque_grid(1, dims, 900), opaque_grid(2, dims, 900)};
  const test::FramesInMemory source(frames);
  const auto path = std::filesystem::path(::testing::TempDir()) / "vox_volume_test.vox";
  OutputOptions options = test::to(Format::kVox);
  ASSERT_TRUE(write_sequence(source, options, path));
  std::ifstream in(path, std::ios::binary);
  const Bytes bytes{std::istreambuf_iterator<char>(in), {}};
  std::filesystem::remove(path);
  const Volume volume = read(bytes);
  expect_same_place(volume.grid, frames[0]);
  EXPECT_TRUE(volume.grid.tiles == frames[0].tiles);
  EXPECT_EQ(warnings_of(volume),
            (std::vector<std::string>{"static-pose: a.vox: frames after the first are left out"}));
}

TEST(VoxVolume, a_model_without_a_scene_graph_turns_to_y_up) {
  const Volume volume =
      read(file({model({4, 3, 2}, {{0, 0, 0, 1}, {3, 0, 0, 2}, {0, 2, 0, 3}, {0, 0, 1, 4}}),
                 palette({{1, 2, 3, 255}, {4, 5, 6, 128}, {7, 8, 9, 0}, {10, 11, 12, 1}})}));
  EXPECT_EQ(dims_of(volume), (Cell{4, 2, 3}));
  EXPECT_EQ(volume.grid.spec.origin_world, glm::dvec3(0));
  EXPECT_EQ(volume.grid.spec.voxel_size, glm::dvec3(1));
  // Alpha 0 is opaque, other alphas stay.
  EXPECT_EQ(cells_of(volume.grid), (Cells{{{0, 0, 2}, {1, 2, 3, 255}},
                                          {{3, 0, 2}, {4, 5, 6, 128}},
                                          {{0, 0, 0}, {7, 8, 9, 255}},
                                          {{0, 1, 2}, {10, 11, 12, 1}}}));
  EXPECT_TRUE(volume.warnings.empty());
}

TEST(VoxVolume, without_a_palette_the_default_one_applies) {
  // Numbers and colours from the table of the specification, which has 0xAABBGGRR.
  const std::vector<std::pair<uint8_t, Color>> expected = {
      {1, {0xff, 0xff, 0xff, 0xff}},   {2, {0xff, 0xff, 0xcc, 0xff}},
      {7, {0xff, 0xcc, 0xff, 0xff}},   {37, {0xcc, 0xff, 0xff, 0xff}},
      {215, {0x00, 0x00, 0x33, 0xff}}, {216, {0xee, 0x00, 0x00, 0xff}},
      {225, {0x11, 0x00, 0x00, 0xff}}, {226, {0x00, 0xee, 0x00, 0xff}},
      {236, {0x00, 0x00, 0xee, 0xff}}, {246, {0xee, 0xee, 0xee, 0xff}},
      {255, {0x11, 0x11, 0x11, 0xff}}};
  std::vector<Color> voxels;
  for (const auto& [number, color] : expected) voxels.push_back({number, 0, 0, number});
  const Cells cells = cells_in(file({model({256, 1, 1}, voxels)}));
  ASSERT_EQ(cells.size(), expected.size());
  for (const auto& [number, color] : expected) {
    EXPECT_EQ(cells.at({number, 0, 0}), color) << int{number};
  }
}

TEST(VoxVolume, empty_voxels_are_left_out_and_the_first_of_a_cell_stays) {
  const Cells cells =
      cells_in(file({model({3, 1, 1}, {{0, 0, 0, 0}, {1, 0, 0, 1}, {1, 0, 0, 216}})}));
  EXPECT_EQ(cells, (Cells{{{1, 0, 0}, {255, 255, 255, 255}}}));
}

TEST(VoxVolume, of_models_without_a_scene_graph_the_first_is_read) {
  const Volume volume = read(file({chunk("PACK", Vox().i32(2)), model({1, 1, 1}, {{0, 0, 0, 1}}),
                                   model({9, 9, 9}, {{8, 8, 8, 2}})}));
  EXPECT_EQ(dims_of(volume), (Cell{1, 1, 1}));
  EXPECT_EQ(cells_of(volume.grid).size(), 1u);
  EXPECT_EQ(warnings_of(volume),
            (std::vector<std::string>{"static-pose: a.vox: frames after the first are left out"}));
}

TEST(VoxVolume, other_chunks_and_bytes_after_the_known_ones_are_skipped) {
  Bytes bytes = file({chunk("NOTE", Vox().raw("what"), chunk("SIZE", {})),
                      model({1, 1, 1}, {{0, 0, 0, 1}}), chunk("MATL", Vox().i32(1)),
                      chunk("PACK", {}), chunk("LAYR", Vox().i32(0).dict({}).i32(-1).i32(7))},
                     200);
  EXPECT_EQ(cells_in(bytes).size(), 1u);
  bytes.push_back(0);
  const Volume volume = read(bytes);
  EXPECT_EQ(cells_of(volume.grid).size(), 1u);
  EXPECT_EQ(warnings_of(volume), (std::vector<std::string>{"trailing-bytes: a.vox: 1 bytes after "
                                                           "the chunk MAIN were left out"}));
}

TEST(VoxVolume, transforms_place_models_about_their_integer_middle) {
  // Middles at 2 of 5 cells and at 1 of 2: cells -2..2 and 9..10 in x.
  const Volume volume =
      read(file({model({5, 1, 1}, {{0, 0, 0, 1}, {4, 0, 0, 2}}), model({2, 2, 2}, {{0, 0, 0, 3}}),
                 transform(0, 1), group(1, {2, 4}), transform(2, 3), shape(3, 0),
                 transform(4, 5, {{"_t", "10 -20 30"}}), shape(5, 1)}));
  // z of the file from 0 to 31, y from -21 to 1.
  EXPECT_EQ(dims_of(volume), (Cell{13, 31, 22}));
  EXPECT_EQ(cells_of(volume.grid), (Cells{{{0, 0, 0}, {255, 255, 255, 255}},
                                          {{4, 0, 0}, {255, 255, 204, 255}},
                                          {{11, 29, 21}, {255, 255, 153, 255}}}));
}

// The example of the specification: rows (0 1 0), (0 0 -1), (-1 0 0).
TEST(VoxVolume, the_rotation_of_the_specification_turns_a_model) {
  const std::string rotation = std::to_string(1 | 2 << 2 | 0 << 4 | 1 << 5 | 1 << 6);
  const Cells cells =
      cells_in(file({model({2, 4, 6}, {{0, 0, 0, 1}, {1, 0, 0, 2}, {0, 3, 0, 3}, {0, 0, 5, 4}}),
                     transform(0, 1, {{"_r", rotation}}), shape(1, 0)}));
  // In the file x' = y, y' = -z, z' = -x; then (x', z', -y') is (y, -x, z).
  EXPECT_EQ(cells, (Cells{{{0, 1, 0}, {255, 255, 255, 255}},
                          {{0, 0, 0}, {255, 255, 204, 255}},
                          {{3, 1, 0}, {255, 255, 153, 255}},
                          {{0, 1, 5}, {255, 255, 102, 255}}}));
}

// All rotations and mirrors of odd and even models beside one that stands still, against the same
// in floating point: the middle of a cell relative to the model's, turned, floored and moved.
TEST(VoxVolume, turned_models_of_odd_and_even_sizes_meet_their_neighbours) {
  const Cell size = {3, 4, 1}, place = {5, -6, 7};
  const std::vector<Color> voxels = {{0, 0, 0, 1}, {2, 3, 0, 2}, {1, 2, 0, 3}, {2, 0, 0, 4}};
  int tested = 0;
  for (int bits = 0; bits < 128; ++bits) {
    const int columns[3] = {bits & 3, bits >> 2 & 3, 3 - (bits & 3) - (bits >> 2 & 3)};
    if (columns[0] > 2 || columns[1] > 2 || columns[0] == columns[1]) continue;
    ++tested;
    const Bytes bytes =
        file({model({1, 1, 1}, {{0, 0, 0, 9}}), model(size, voxels), transform(0, 1),
              group(1, {2, 4}), transform(2, 3, {{"_t", "-9 -9 -9"}}), shape(3, 0),
              transform(4, 5, {{"_r", std::to_string(bits)}, {"_t", "5 -6 7"}}), shape(5, 1)});
    // Relative to the still model at cell (-9, -9, -9), which is the least in the file's x, y, z.
    const Volume volume = read(bytes);
    const Cells cells = cells_of(volume.grid);
    ASSERT_EQ(cells.size(), 5u) << bits;
    const int depth = volume.grid.spec.dims.z;
    for (const Color& voxel : voxels) {
      Cell at{};
      for (size_t row = 0; row < 3; ++row) {
        const auto from = static_cast<size_t>(columns[row]);
        const double middle = voxel[from] + 0.5 - std::floor(size[from] / 2.0);
        const double sign = (bits >> (4 + row) & 1) != 0 ? -1 : 1;
        at[row] = static_cast<int>(std::floor(sign * middle)) + place[row];
      }
      const auto found = cells.find({at[0] + 9, at[2] + 9, depth - 1 - (at[1] + 9)});
      ASSERT_NE(found, cells.end()) << bits;
      EXPECT_EQ(found->second[2], (Color{255, 204, 153, 102})[voxel[3] - 1u]) << bits;
    }
  }
  EXPECT_EQ(tested, 48);
}

TEST(VoxVolume, a_turned_group_turns_the_places_of_its_members) {
  // A quarter turn about z, rows (0 -1 0), (1 0 0), (0 0 1): 1 | 0 << 2 | 1 << 4.
  const Bytes bytes =
      file({model({2, 2, 2}, {{1, 1, 0, 1}}), model({2, 2, 2}, {{1, 1, 0, 2}}), transform(0, 1),
            group(1, {2, 8}), transform(2, 3, {{"_r", "17"}, {"_t", "100 0 0"}}), group(3, {4}),
            transform(4, 5, {{"_t", "10 0 0"}}), shape(5, 0), transform(8, 9), shape(9, 1)});
  // The first: (0, 0) of its middle, at (10, 0), turns to (-1, 10), moves to (99, 10); the other
  // is at (0, 0). The box begins at (-1, -1) and ends at y 11.
  EXPECT_EQ(cells_in(bytes),
            (Cells{{{100, 0, 0}, {255, 255, 255, 255}}, {{1, 0, 10}, {255, 255, 204, 255}}}));
}

TEST(VoxVolume, a_node_named_twice_is_placed_twice_and_the_first_model_of_a_cell_shows) {
  const Bytes bytes =
      file({model({2, 1, 1}, {{0, 0, 0, 1}, {1, 0, 0, 2}}), transform(0, 1), group(1, {2, 3}),
            transform(2, 4), transform(3, 4, {{"_t", "1 0 0"}}), shape(4, 0)});
  EXPECT_EQ(cells_in(bytes), (Cells{{{0, 0, 0}, {255, 255, 255, 255}},
                                    {{1, 0, 0}, {255, 255, 204, 255}},
                                    {{2, 0, 0}, {255, 255, 204, 255}}}));
}

TEST(VoxVolume, hidden_nodes_and_layers_are_left_out) {
  const Bytes bytes =
      file({model({1, 1, 1}, {{0, 0, 0, 1}}), transform(0, 1), group(1, {2, 4, 6, 8, 10}),
            transform(2, 3, {{"_t", "0 0 5"}}, {}, 1), shape(3, 0),
            transform(4, 3, {{"_t", "0 0 6"}}, {{"_name", "a"}, {"_hidden", "1"}}),
            transform(6, 3, {{"_t", "0 0 7"}}, {{"_hidden", "0"}}, 0),
            transform(8, 9, {{"_t", "0 0 8"}}), group(9, {6}, {{"_hidden", "1"}}),
            transform(10, 11, {{"_t", "0 0 9"}}), shape(11, 0, {{"_hidden", "1"}}),
            chunk("LAYR", Vox().i32(1).dict({{"_hidden", "1"}}).i32(-1)),
            chunk("LAYR", Vox().i32(0).dict({{"_hidden", "0"}}).i32(-1))});
  const Volume volume = read(bytes);
  EXPECT_EQ(dims_of(volume), (Cell{1, 1, 1}));
  EXPECT_EQ(cells_of(volume.grid).size(), 1u);
  EXPECT_EQ(warnings_of(volume),
            (std::vector<std::string>{"hidden-nodes: a.vox: 4 hidden nodes were left out"}));
  const Volume nothing = read(file(
      {model({5, 5, 5}, {{0, 0, 0, 1}}), transform(0, 1, {}, {{"_hidden", "1"}}), shape(1, 0)}));
  EXPECT_EQ(dims_of(nothing), (Cell{1, 1, 1}));
  EXPECT_TRUE(nothing.grid.tiles.empty());
}

TEST(VoxVolume, of_an_animation_the_first_frame_is_read) {
  const Bytes two_frames = chunk("nTRN", Vox()
                                             .i32(0)
                                             .dict({})
                                             .i32(1)
                                             .i32(-1)
                                             .i32(0)
                                             .i32(2)
                                             .dict({{"_f", "0"}, {"_t", "0 0 1"}})
                                             .dict({{"_f", "9"}, {"_t", "7 7 7"}}));
  const Bytes models = chunk("nSHP", Vox()
                                         .i32(1)
                                         .dict({{"_loop", "1"}})
                                         .i32(2)
                                         .i32(1)
                                         .dict({{"_f", "0"}})
                                         .i32(0)
                                         .dict({{"_f", "5"}}));
  const Volume volume = read(
      file({model({9, 9, 9}, {{0, 0, 0, 1}}), model({1, 1, 1}, {{0, 0, 0, 2}}), two_frames, models},
           200));
  EXPECT_EQ(cells_of(volume.grid), (Cells{{{0, 0, 0}, {255, 255, 204, 255}}}));
  EXPECT_EQ(warnings_of(volume),
            (std::vector<std::string>{"static-pose: a.vox: frames after the first are left out"}));
}

TEST(VoxVolume, the_place_of_the_root_applies_where_all_models_lie_in_its_grid) {
  const auto with = [](const Dict& root, const std::string& place) {
    return file({model({2, 2, 2}, {{0, 0, 0, 1}}), transform(0, 1, {}, root),
                 transform(1, 2, {{"_t", place}}), shape(2, 0)});
  };
  const Dict root = {{"dims", "10,20,30"}, {"origin", "1,2.5,-3"}, {"voxel_size", "0.5,1,2"}};
  const Volume inside = read(with(root, "0 0 1"));
  EXPECT_EQ(dims_of(inside), (Cell{10, 20, 30}));
  EXPECT_EQ(inside.grid.spec.origin_world, glm::dvec3(1, 2.5, -3));
  EXPECT_EQ(inside.grid.spec.voxel_size, glm::dvec3(0.5, 1, 2));
  // Scene cell (-1, -1, 0) in a scene from (-5, -15, 0) to (5, 15, 20).
  EXPECT_EQ(cells_of(inside.grid), (Cells{{{4, 0, 15}, {255, 255, 255, 255}}}));

  for (const auto& place : {"0 0 0", "0 0 20", "-5 0 1", "5 0 1", "0 15 1"}) {
    const Volume outside = read(with(root, place));
    EXPECT_EQ(dims_of(outside), (Cell{2, 2, 2})) << place;
    EXPECT_EQ(outside.grid.spec.origin_world, glm::dvec3(0));
    EXPECT_EQ(warnings_of(outside),
              (std::vector<std::string>{
                  "ignored-placement: a.vox: models lie outside of the grid that the root node "
                  "names; its origin and voxel size are left out"}));
  }
  for (const auto& [key, value] : Dict{{"dims", "10,20"},
                                       {"dims", "10,20,0"},
                                       {"dims", "10,20.5,30"},
                                       {"dims", "10,20,16385"},
                                       {"dims", "1e99,20,30"},
                                       {"origin", "1,2,inf"},
                                       {"origin", "1,2,1e31"},
                                       {"voxel_size", "1,0,1"},
                                       {"voxel_size", "1,-1,1"},
                                       {"voxel_size", ""}}) {
    Dict broken = root;
    for (auto& pair : broken) {
      if (pair.first == key) pair.second = value;
    }
    const Volume volume = read(with(broken, "0 0 1"));
    EXPECT_EQ(dims_of(volume), (Cell{2, 2, 2})) << key << value;
    EXPECT_EQ(volume.grid.spec.voxel_size, glm::dvec3(1));
  }
}

TEST(VoxVolume, broken_files_are_refused_with_their_place) {
  const Bytes one = model({1, 1, 1}, {{0, 0, 0, 1}});
  const Bytes xyzi = chunk("XYZI", Vox().i32(0));
  const auto frame = [&](const std::string& key, const std::string& value) {
    return file({one, transform(0, 1, {{key, value}}), shape(1, 0)});
  };
  const std::string rotation =
      "a.vox: byte 114, chunk nTRN: not a rotation: expected bits 0-1 and 2-3 that are two of 0, "
      "1, 2, and signs, got ";
  const std::string moved =
      "a.vox: byte 114, chunk nTRN: not a translation: expected three integers, got ";
  const std::vector<std::pair<Bytes, std::string>> table = {
      {Vox().raw("VOX ").i32(150).raw("MAI").bytes,
       "a.vox: byte 8: a chunk's header is cut off: expected 4 bytes, got 3"},
      {Vox().raw("VOX ").i32(150).raw(chunk("SIZE", {})).bytes,
       "a.vox: byte 8: not the root chunk: expected \"MAIN\", got \"SIZE\""},
      {Vox().raw("VOX ").i32(150).raw("MAIN").i32(0).i32(-1).bytes,
       "a.vox: byte 8: the chunk \"MAIN\" is cut off: expected 4294967295 bytes, got 0"},
      {file({}), "a.vox: the file has no model: expected a chunk XYZI, got none"},
      {file({Vox().raw("SIZE").i32(12).i32(-1).bytes}),
       "a.vox: byte 20: the chunk \"SIZE\" is cut off: expected 4294967307 bytes, got 0"},
      {file({Vox().raw("a\nb\xff").i32(1).i32(0).bytes}),
       "a.vox: byte 20: the chunk \"a\\x0ab\\xff\" is cut off: expected 1 bytes, got 0"},
      {file({chunk("SIZE", Vox().i32(1).i32(1))}),
       "a.vox: byte 40, chunk SIZE: cut off: expected 4 bytes, got 0"},
      {file({size_chunk({1, 0, 1}), xyzi}),
       "a.vox: byte 36, chunk SIZE: the side of a model is out of range: expected 1 to 256, got 0"},
      {file({size_chunk({1, 1, 257}), xyzi}),
       "a.vox: byte 40, chunk SIZE: the side of a model is out of range: expected 1 to 256, got "
       "257"},
      {file({size_chunk({1, 1, 1})}),
       "a.vox: byte 44: the last chunk SIZE has no voxels: expected a chunk XYZI, got none"},
      {file({size_chunk({1, 1, 1}), size_chunk({1, 1, 1}), xyzi}),
       "a.vox: byte 44, chunk SIZE: the chunk SIZE before has no voxels: expected a chunk XYZI, "
       "got SIZE"},
      {file({xyzi}),
       "a.vox: byte 20, chunk XYZI: voxels of a model without size: expected a chunk SIZE before "
       "it, got none"},
      {file({size_chunk({1, 1, 1}), chunk("XYZI", Vox().i32(-1))}),
       "a.vox: byte 56, chunk XYZI: more voxels than the chunk can hold: expected at most 0, got "
       "4294967295"},
      {file({size_chunk({1, 1, 1}), chunk("XYZI", Vox().i32(2).i32(0).raw("abc"))}),
       "a.vox: byte 56, chunk XYZI: more voxels than the chunk can hold: expected at most 1, got "
       "2"},
      {file({model({2, 2, 1}, {{1, 1, 0, 1}, {1, 2, 0, 1}})}),
       "a.vox: byte 64, chunk XYZI: a voxel is outside of its model: expected 0 to 1 in y, got 2"},
      {file({one, chunk("RGBA", Vox().raw(std::string(1023, 'x')))}),
       "a.vox: byte 76, chunk RGBA: the palette is cut off: expected 1024 bytes, got 1023"},
      {file({one, chunk("nTRN", Vox().i32(0).i32(1 << 29))}),
       "a.vox: byte 80, chunk nTRN: more pairs than the chunk can hold: expected at most 0, got "
       "536870912"},
      {file({one, chunk("nTRN", Vox().i32(0).i32(1).i32(-1).i32(0))}),
       "a.vox: byte 88, chunk nTRN: a text is cut off: expected 4294967295 bytes, got 4"},
      {file({one, chunk("nTRN", Vox().i32(0).dict({}).i32(1).i32(-1).i32(-1).i32(0))}),
       "a.vox: byte 96, chunk nTRN: a node without frames: expected at least 1, got 0"},
      {file({one, chunk("nGRP", Vox().i32(0).dict({}).i32(3).i32(1).i32(1))}),
       "a.vox: byte 84, chunk nGRP: more children than the chunk can hold: expected at most 2, got "
       "3"},
      {file({one, chunk("nSHP", Vox().i32(0).dict({}).i32(0))}),
       "a.vox: byte 84, chunk nSHP: a node without frames: expected at least 1, got 0"},
      {frame("_r", "128"), rotation + "\"128\""},
      {frame("_r", "0"), rotation + "\"0\""},
      {frame("_r", "3"), rotation + "\"3\""},
      {frame("_r", ""), rotation + "\"\""},
      {frame("_t", "1 2"), moved + "\"1 2\""},
      {frame("_t", "1 2 3 4"), moved + "\"1 2 3 4\""},
      {frame("_t", "1 2 2147483648"), moved + "\"1 2 2147483648\""},
      {frame("_t", "1 2 3" + std::string(50, '0')),
       moved + "\"1 2 3" + std::string(35, '0') + "…\""},
      {file({one, group(0, {}), shape(0, 0)}),
       "a.vox: node 0: two nodes with this id: expected one, got several"},
      {file({one, group(1, {})}),
       "a.vox: the root: a node that the file lacks: expected the id of a node, got 0"},
      {file({one, group(0, {7}), shape(1, 0)}),
       "a.vox: node 0: a node that the file lacks: expected the id of a node, got 7"},
      {file({one, shape(0, 1)}), "a.vox: node 0: a model that the file lacks: expected 0, got 1"},
      {file({one, one, shape(0, -1)}),
       "a.vox: node 0: a model that the file lacks: expected 0 to 1, got -1"},
      {file({one, transform(0, 1), group(1, {0})}),
       "a.vox: node 1: nodes are nested too deeply: expected at most 64, got more"},
  };
  for (const auto& [bytes, message] : table) EXPECT_EQ(error_of(bytes), message);
  EXPECT_EQ(load_volume("a.vox", table[3].first, 0).error().code, ErrorCode::kMalformedMesh);
}

TEST(VoxVolume, every_truncation_is_refused) {
  const Bytes bytes =
      file({model({2, 2, 2}, {{0, 0, 0, 1}, {1, 1, 1, 2}}), transform(0, 1), group(1, {2}),
            transform(2, 3, {{"_t", "1 2 3"}, {"_r", "4"}}), shape(3, 0), palette({{1, 2, 3, 4}}),
            chunk("LAYR", Vox().i32(0).dict({{"_hidden", "1"}}).i32(-1))});
  ASSERT_EQ(cells_in(bytes).size(), 2u);
  for (size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(load_volume("a.vox", std::span(bytes).first(size), 0)) << size;
  }
}

TEST(VoxVolume, bytes_that_change_give_a_grid_or_an_error) {
  const Bytes bytes =
      file({model({2, 2, 2}, {{0, 0, 0, 1}, {1, 1, 1, 2}}), transform(0, 1), group(1, {2, 4}),
            transform(2, 3, {{"_t", "1 2 3"}, {"_r", "4"}}), shape(3, 0), transform(4, 3)});
  int read = 0;
  for (size_t at = 0; at < bytes.size(); ++at) {
    for (int value = 0; value < 256; ++value) {
      Bytes changed = bytes;
      changed[at] = static_cast<uint8_t>(value);
      const auto volume = load_volume("a.vox", changed, 0);
      read += volume ? 1 : 0;
      EXPECT_TRUE(volume || volume.error().code != ErrorCode::kInternal) << at;
    }
  }
  EXPECT_GT(read, 0);
}

TEST(VoxVolume, pairs_and_nodes_have_cancellation_points) {
  const auto points_of = [](const Bytes& bytes) {
    return test::points_passed([&] { EXPECT_EQ(error_of(bytes), "no error"); });
  };
  constexpr int kCount = 1000;
  const Bytes one = model({1, 1, 1}, {{0, 0, 0, 1}});
  const Dict pairs(kCount, Dict::value_type("key", "value"));
  EXPECT_GE(points_of(file({one, transform(0, 1, {}, pairs), shape(1, 0)})), kCount);

  // One for each chunk, and more for the comparisons that sort the nodes.
  std::vector<Bytes> chunks = {one, shape(0, 0)};
  for (int id = kCount; id > 0; --id) chunks.push_back(group(id, {}));
  EXPECT_GE(points_of(file(chunks)), 3 * kCount);
}

TEST(VoxVolume, a_graph_that_multiplies_its_nodes_is_refused) {
  std::vector<Bytes> chunks = {model({1, 1, 1}, {{0, 0, 0, 1}})};
  for (int i = 0; i < 40; ++i) chunks.push_back(group(i, {i + 1, i + 1}));
  chunks.push_back(shape(40, 0));
  const auto volume = load_volume("a.vox", file(chunks), 0);
  ASSERT_FALSE(volume);
  EXPECT_EQ(volume.error().code, ErrorCode::kMalformedMesh);
  EXPECT_EQ(volume.error().detail.substr(0, 12), "a.vox: node ");
  EXPECT_EQ(volume.error().expected, "at most 1048576");
}

TEST(VoxVolume, nodes_are_nested_up_to_the_limit) {
  for (const int count : {64, 65}) {
    std::vector<Bytes> chunks = {model({1, 1, 1}, {{0, 0, 0, 1}})};
    for (int i = 0; i + 1 < count; ++i) {
      chunks.push_back(transform(i, i + 1, {{"_t", "2147483647 -2147483648 1"}}));
    }
    chunks.push_back(shape(count - 1, 0));
    EXPECT_EQ(error_of(file(chunks)),
              count == 64 ? "no error"
                          : "a.vox: node 63: nodes are nested too deeply: expected at most 64, "
                            "got more");
  }
}

TEST(VoxVolume, more_cells_or_voxels_than_a_grid_has_are_refused) {
  const auto apart = [](const std::string& place) {
    return file({model({1, 1, 1}, {{0, 0, 0, 1}}), group(0, {1, 2}), transform(1, 3),
                 transform(2, 3, {{"_t", place}}), shape(3, 0)});
  };
  EXPECT_EQ(dims_of(read(apart("0 -16383 0"))), (Cell{1, 1, 16384}));
  EXPECT_EQ(error_of(apart("0 0 16384")),
            "a.vox: too many cells on a side: expected at most 16384, got 1 x 16385 x 1");
  EXPECT_EQ(error_of(apart("-2147483648 0 0")),
            "a.vox: too many cells on a side: expected at most 16384, got 2147483649 x 1 x 1");

  // 2^16 entries, placed 2^12 + 1 times.
  const std::vector<Color> voxels(65536, Color{0, 0, 0, 0});
  const Bytes many =
      file({model({1, 1, 1}, voxels), group(0, std::vector<int>(4097, 1)), shape(1, 0)});
  const auto volume = load_volume("a.vox", many, 0);
  ASSERT_FALSE(volume);
  EXPECT_EQ(volume.error().code, ErrorCode::kGridTooLarge);
  EXPECT_EQ(volume.error().message(),
            "a.vox: too many voxels: expected at most 268435456, got 268500992");
}

}  // namespace
}  // namespace voxeld::vox_volume_test
