// Meshes of hexahedra (vtu, inp), read by what their specifications say: nodes against the corners
// of the grid's voxels, values against the sparse arrays of npz.
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <map>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "server/formats/cells/hexahedra.h"
#include "server/formats/formats.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using test::to;
using Bytes = std::vector<uint8_t>;
using HexCell = std::array<int32_t, 3>;

// The corners of a cell in the order of VTK_HEXAHEDRON and C3D8.
constexpr HexCell kHexahedron[8] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                    {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};

Bytes cells_encoded(const Grid& grid, const OutputOptions& options) {
  auto bytes = encode(grid, options);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return bytes ? *std::move(bytes) : Bytes();
}

// A mesh as a file has it.
struct HexMesh {
  std::vector<std::array<double, 3>> points;
  std::vector<std::array<int64_t, 8>> cells;  // points from 0
};

// The voxels' cells in the order of their Morton codes.
std::vector<HexCell> hex_cells_of(const Grid& grid) {
  std::vector<HexCell> cells;
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int32_t x, int32_t y, int32_t z, size_t) {
      cells.push_back({x, y, z});
    });
  }
  return cells;
}

// tolerance: of a coordinate, in voxels.
void expect_mesh_of(const Grid& grid, const HexMesh& mesh, double tolerance) {
  const std::vector<HexCell> cells = hex_cells_of(grid);
  ASSERT_EQ(mesh.cells.size(), cells.size());
  std::map<HexCell, int64_t> nodes;
  for (size_t i = 0; i < cells.size(); ++i) {
    for (size_t corner = 0; corner < 8; ++corner) {
      HexCell p = cells[i];
      for (size_t c = 0; c < 3; ++c) p[c] += kHexahedron[corner][c];
      const int64_t node = mesh.cells[i][corner];
      ASSERT_TRUE(node >= 0 && node < static_cast<int64_t>(mesh.points.size()));
      ASSERT_EQ(nodes.try_emplace(p, node).first->second, node) << "a corner with two nodes";
      for (int c = 0; c < 3; ++c) {
        const auto axis = static_cast<size_t>(c);
        const double wanted = grid.spec.origin_world[c] + p[axis] * grid.spec.voxel_size[c];
        const auto at = mesh.points[static_cast<size_t>(node)][axis];
        ASSERT_NEAR(at, wanted, tolerance * grid.spec.voxel_size[c]);
      }
    }
  }
  std::set<int64_t> used;
  for (const auto& [p, node] : nodes) used.insert(node);
  EXPECT_EQ(used.size(), nodes.size()) << "a node at two corners";
  EXPECT_EQ(mesh.points.size(), nodes.size()) << "nodes without a voxel";
}

Grid cells_grid(const glm::dvec3& voxel_size) {
  std::mt19937 random(11);
  const ChannelSet channels = channels_of_bits(~uint32_t{0});
  Grid grid =
      test::grid_of({300, 270, 33}, test::random_voxels(random, {300, 250, 33}, 2500), channels);
  std::mt19937 values(3);
  for (SparseTile& tile : grid.tiles) {
    for_each_channel(tile, [&](Channel channel, auto& samples) {
      for (auto& sample : samples) {
        sample = static_cast<std::decay_t<decltype(sample)>>(
            channel_info(channel).is_id() ? values() % 5 : values());
      }
    });
  }
  // Full bricks at the end of the first tile, so that their corners lie in all tiles around it.
  std::erase_if(grid.tiles, [](const SparseTile& tile) { return tile.coord[1] > 0; });
  SparseTile& first = grid.tiles[0];
  const auto at_end = std::ranges::lower_bound(first.brick_morton, morton_encode(30, 30, 2));
  first.full = {{morton_encode(30, 30, 2), 1}};
  EXPECT_TRUE(at_end == first.brick_morton.end() || *at_end >= morton_encode(30, 30, 2) + 8);
  grid.spec.voxel_size = voxel_size;
  grid.spec.origin_world = {-1.5, 0.25, 3};
  grid.meta = GridMeta::parse(R"({"units":"mm","labels":[{"id":1,"name":"a \"roof\""},
      {"id":3,"name":"VOXELS"},{"id":4,"name":"A__roof_"}],"materials":[{"id":2,"name":"wood"}]})");
  return grid;
}

Grid far_cells_grid() {
  return test::random_grid(5, {40, 30, 20}, 300, true, false);  // z = 1e10, voxels of 1/8
}

// The elements and arrays of a .vtu.
class VtuReader {
 public:
  explicit VtuReader(const Bytes& bytes) : bytes_(bytes) {
    constexpr std::string_view kMarker = "<AppendedData encoding=\"raw\">\n_";
    constexpr std::string_view kEnd = "\n</AppendedData>\n</VTKFile>\n";
    const auto found = std::search(bytes.begin(), bytes.end(), kMarker.begin(), kMarker.end());
    EXPECT_NE(found, bytes.end());
    begin_ = static_cast<size_t>(found - bytes.begin()) + kMarker.size();
    text_.assign(bytes.begin(), found);
    EXPECT_TRUE(std::string(bytes.end() - static_cast<ptrdiff_t>(kEnd.size()), bytes.end()) ==
                kEnd);
    next_ = begin_;
  }
  const std::string& text() const { return text_; }
  // An attribute of the first element with this beginning.
  std::string attribute(std::string_view begin, std::string_view name) const {
    const size_t at = text_.find(begin);
    EXPECT_NE(at, std::string::npos) << begin;
    const size_t value = text_.find(' ' + std::string(name) + "=\"", at) + name.size() + 3;
    return text_.substr(value, text_.find('"', value) - value);
  }
  // The samples of the next array in the file: there is no gap between arrays.
  Bytes next(const std::string& type, const std::string& name, int components) {
    std::string begin = "<DataArray type=\"" + type + "\" Name=\"" + name + "\"";
    if (components > 1) begin += " NumberOfComponents=\"" + std::to_string(components) + "\"";
    EXPECT_EQ(attribute(begin, "format"), "appended");
    EXPECT_EQ(attribute(begin, "offset"), std::to_string(next_ - begin_)) << name;
    const auto blocks = number<uint64_t>(0), block = number<uint64_t>(8);
    const auto last = number<uint64_t>(16);
    Bytes out;
    size_t at = 8 * (3 + blocks);
    for (size_t i = 0; i < blocks; ++i) {
      Bytes raw(i + 1 == blocks && last > 0 ? last : block);
      auto length = static_cast<uLongf>(raw.size());
      const auto stored = number<uint64_t>(8 * (3 + i));
      EXPECT_EQ(uncompress(raw.data(), &length, &bytes_[next_ + at], static_cast<uLong>(stored)),
                Z_OK);
      EXPECT_EQ(length, raw.size());
      out.insert(out.end(), raw.begin(), raw.end());
      at += stored;
    }
    next_ += at;
    return out;
  }
  std::string next_text(const std::string& name) {
    const Bytes bytes = next("UInt8", name, 1);
    return {bytes.begin(), bytes.end()};
  }
  void expect_end() const { EXPECT_EQ(next_ + 28, bytes_.size()); }

 private:
  template <typename T>
  T number(size_t at) const {
    T value{};
    std::memcpy(&value, &bytes_.at(next_ + at), sizeof value);
    return value;
  }

  const Bytes& bytes_;
  std::string text_;
  size_t begin_ = 0, next_ = 0;
};

template <typename T>
std::vector<T> vtu_numbers_of(const Bytes& bytes) {
  std::vector<T> numbers(bytes.size() / sizeof(T));
  if (!numbers.empty()) std::memcpy(numbers.data(), bytes.data(), bytes.size());
  return numbers;
}

template <typename Number>
HexMesh next_mesh(VtuReader& reader) {
  HexMesh mesh;
  const auto points =
      vtu_numbers_of<Number>(reader.next(sizeof(Number) == 4 ? "Float32" : "Float64", "Points", 3));
  for (size_t i = 0; i < points.size(); i += 3) {
    mesh.points.push_back({points[i], points[i + 1], points[i + 2]});
  }
  const auto corners = vtu_numbers_of<int32_t>(reader.next("Int32", "connectivity", 1));
  for (size_t i = 0; i < corners.size(); i += 8) {
    auto& cell = mesh.cells.emplace_back();
    std::copy_n(&corners[i], 8, cell.begin());
  }
  const auto offsets = vtu_numbers_of<int32_t>(reader.next("Int32", "offsets", 1));
  EXPECT_EQ(offsets.size(), mesh.cells.size());
  for (size_t i = 0; i < offsets.size(); ++i) EXPECT_EQ(offsets[i], 8 * (i + 1));
  EXPECT_TRUE(reader.next("UInt8", "types", 1) == Bytes(mesh.cells.size(), 12));
  EXPECT_EQ(reader.attribute("<Piece", "NumberOfPoints"), std::to_string(mesh.points.size()));
  EXPECT_EQ(reader.attribute("<Piece", "NumberOfCells"), std::to_string(mesh.cells.size()));
  return mesh;
}

// The rows of npz in layout sparse; distances become world units.
Bytes cell_rows_of(const Grid& grid, Channel channel, const OutputOptions& options) {
  const VoxelPieces voxels(grid);
  const SparseArray array(voxels, channel, options);
  Bytes all(array.bytes());
  for (size_t piece = 0; piece < array.piece_count(); ++piece) {
    array.fill(piece, std::span(all).subspan(array.piece_begin(piece), array.piece_bytes(piece)));
  }
  const glm::dvec3 size = grid.spec.voxel_size;
  if (channel != Channel::kDistance || size.x != size.y || size.x != size.z) return all;
  for (size_t at = 0; at < all.size(); at += 4) {
    float value = 0;
    std::memcpy(&value, &all[at], sizeof value);
    value = static_cast<float>(value * size.x);
    std::memcpy(&all[at], &value, sizeof value);
  }
  return all;
}

TEST(Vtu, has_the_corners_of_voxels_once_and_every_channel) {
  for (const glm::dvec3 size : {glm::dvec3(0.25), glm::dvec3(0.5, 0.25, 0.125)}) {
    for (const DType dtype : {DType::kUint8, DType::kFloat32}) {
      const Grid grid = cells_grid(size);
      OutputOptions options = to(Format::kVtu);
      options.dtype = dtype;
      const Bytes bytes = cells_encoded(grid, options);
      VtuReader reader(bytes);
      EXPECT_EQ(vtu_numbers_of<double>(reader.next("Float64", "origin", 3)),
                (std::vector<double>{-1.5, 0.25, 3}));
      EXPECT_EQ(vtu_numbers_of<double>(reader.next("Float64", "voxel_size", 3)),
                (std::vector<double>{size.x, size.y, size.z}));
      EXPECT_EQ(vtu_numbers_of<int32_t>(reader.next("Int32", "dims", 3)),
                (std::vector<int32_t>{300, 270, 33}));
      EXPECT_EQ(reader.next_text("units"), "mm");
      EXPECT_EQ(reader.next_text("up"), "y");
      EXPECT_EQ(reader.next_text("labels"), std::string("\0a \"roof\"\0\0VOXELS\0A__roof_\0", 27));
      EXPECT_EQ(reader.next_text("materials"), std::string("\0\0wood\0", 7));
      EXPECT_EQ(reader.next_text("meta"), grid.meta.text());
      expect_mesh_of(grid, next_mesh<float>(reader), 0);
      const auto coords = vtu_numbers_of<HexCell>(reader.next("Int32", "cell", 3));
      EXPECT_TRUE(coords == hex_cells_of(grid));
      const bool is_float = dtype == DType::kFloat32;
      const std::tuple<Channel, std::string, int> arrays[] = {
          {Channel::kColor, is_float ? "Float32" : "UInt8", 4},
          {Channel::kNormal, is_float ? "Float32" : "Int8", 3},
          {Channel::kMaterial, "UInt16", 1},
          {Channel::kLabel, "UInt16", 1},
          {Channel::kDistance, "Float32", 1},
          {Channel::kCoverage, is_float ? "Float32" : "UInt8", 1}};
      for (const auto& [channel, type, components] : arrays) {
        const std::string name(channel_info(channel).name);
        EXPECT_TRUE(reader.next(type, name, components) == cell_rows_of(grid, channel, options))
            << name;
      }
      reader.expect_end();
    }
  }
}

TEST(Vtu, points_far_from_the_origin_are_doubles) {
  const Grid grid = far_cells_grid();
  const Bytes bytes = cells_encoded(grid, to(Format::kVtu));
  VtuReader reader(bytes);
  reader.next("Float64", "origin", 3);
  reader.next("Float64", "voxel_size", 3);
  reader.next("Int32", "dims", 3);
  for (const char* name : {"units", "up", "meta"}) reader.next_text(name);
  expect_mesh_of(grid, next_mesh<double>(reader), 1e-3);
}

TEST(Vtu, a_grid_without_voxels_has_no_points_and_no_cells) {
  Grid grid;
  const Bytes bytes = cells_encoded(grid, to(Format::kVtu));
  VtuReader reader(bytes);
  reader.next("Float64", "origin", 3);
  reader.next("Float64", "voxel_size", 3);
  reader.next("Int32", "dims", 3);
  for (const char* name : {"up", "meta"}) reader.next_text(name);
  const HexMesh mesh = next_mesh<float>(reader);
  EXPECT_TRUE(mesh.points.empty() && mesh.cells.empty());
  EXPECT_TRUE(reader.next("Int32", "cell", 3).empty());
  reader.expect_end();
}

TEST(Vtu, offsets_behind_the_quote_have_room_and_no_spaces_inside) {
  const Bytes bytes = cells_encoded(far_cells_grid(), to(Format::kVtu));
  const std::string text = VtuReader(bytes).text();
  EXPECT_TRUE(
      text.starts_with("<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\""
                       " version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\""
                       " compressor=\"vtkZLibDataCompressor\">\n"))
      << text;
  EXPECT_NE(text.find(" offset=\"0\"                   />\n"), std::string::npos);
}

// Full tiles, and a full brick.
Grid many_cells(uint32_t full_tiles) {
  Grid grid;
  const auto tiles = static_cast<int>(full_tiles);
  grid.spec.dims = {tiles * limits::kTileSide + 8, limits::kTileSide, limits::kTileSide};
  for (int x = 0; x <= tiles; ++x) {
    SparseTile& tile = grid.tiles.emplace_back();
    tile.coord = {x, 0, 0};
    tile.full = {{0, x < tiles ? kTileLevels : 0}};
  }
  normalize_tiles(grid);
  return grid;
}

TEST(Vtu, more_voxels_than_32_bit_numbers_allow_are_refused) {
  EXPECT_EQ(encode(many_cells(16), to(Format::kVtu)).error().message(),
            "vtu: too many voxels for 32-bit numbers of nodes: expected at most 268435455 voxels, "
            "got 268435968");
}

TEST(Inp, more_voxels_than_lines_may_be_are_refused) {
  EXPECT_EQ(encode(many_cells(4), to(Format::kInp)).error().message(),
            "inp: too many voxels for lines: expected at most 67108864, got 67109376");
}

// The blocks of an input deck: a line of a keyword and the numbers of the lines after it.
struct InpBlock {
  std::string keyword;
  std::vector<std::vector<std::string>> lines;
};

std::vector<InpBlock> inp_blocks_of(const Bytes& bytes) {
  std::istringstream text(std::string(bytes.begin(), bytes.end()));
  std::vector<InpBlock> blocks;
  for (std::string line; std::getline(text, line);) {
    EXPECT_LE(line.size(), 256U);
    if (line.starts_with("**")) continue;
    if (line.starts_with("*")) {
      blocks.push_back({line, {}});
      continue;
    }
    std::istringstream words(line);
    auto& numbers = blocks.back().lines.emplace_back();
    for (std::string word; std::getline(words, word, ',');) {
      EXPECT_TRUE(blocks.back().keyword == "*HEADING" || word.size() <= 20) << word;
      numbers.push_back(word);
    }
  }
  return blocks;
}

HexMesh inp_mesh(const std::vector<InpBlock>& blocks) {
  HexMesh mesh;
  EXPECT_EQ(blocks.at(0).keyword, "*HEADING");
  EXPECT_EQ(blocks.at(1).keyword, "*NODE");
  EXPECT_EQ(blocks.at(2).keyword, "*ELEMENT, TYPE=C3D8, ELSET=voxels");
  for (const auto& line : blocks.at(1).lines) {
    EXPECT_EQ(line.size(), 4U);
    EXPECT_EQ(line[0], std::to_string(mesh.points.size() + 1));
    mesh.points.push_back({std::stod(line[1]), std::stod(line[2]), std::stod(line[3])});
  }
  for (const auto& line : blocks.at(2).lines) {
    EXPECT_EQ(line.size(), 9U);
    EXPECT_EQ(line[0], std::to_string(mesh.cells.size() + 1));
    auto& cell = mesh.cells.emplace_back();
    for (size_t i = 0; i < 8; ++i) cell[i] = std::stoll(line[i + 1]) - 1;
  }
  return mesh;
}

// Sets by name: the numbers of their elements.
std::map<std::string, std::vector<int>> inp_sets(const std::vector<InpBlock>& blocks) {
  std::map<std::string, std::vector<int>> sets;
  for (size_t i = 3; i < blocks.size(); ++i) {
    EXPECT_TRUE(blocks[i].keyword.starts_with("*ELSET, ELSET=")) << blocks[i].keyword;
    auto& elements = sets[blocks[i].keyword.substr(14)];
    EXPECT_TRUE(elements.empty());
    for (const auto& line : blocks[i].lines) {
      EXPECT_LE(line.size(), 16U);
      for (const std::string& word : line) elements.push_back(std::stoi(word));
    }
  }
  return sets;
}

std::vector<int> elements_with(const Grid& grid, Channel channel, uint16_t id) {
  const std::vector<uint16_t> ids = vtu_numbers_of<uint16_t>(cell_rows_of(grid, channel, {}));
  std::vector<int> elements;
  for (size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] == id) elements.push_back(static_cast<int>(i) + 1);
  }
  return elements;
}

TEST(Inp, has_the_corners_of_voxels_once_and_a_set_for_each_label) {
  const Grid grid = cells_grid({0.5, 0.25, 0.125});
  const std::vector<InpBlock> blocks = inp_blocks_of(cells_encoded(grid, to(Format::kInp)));
  expect_mesh_of(grid, inp_mesh(blocks), 0);
  const auto sets = inp_sets(blocks);
  const std::map<std::string, std::vector<int>> wanted = {
      {"a__roof_", elements_with(grid, Channel::kLabel, 1)},
      {"label_2", elements_with(grid, Channel::kLabel, 2)},
      {"VOXELS_3", elements_with(grid, Channel::kLabel, 3)},
      {"A__roof__4", elements_with(grid, Channel::kLabel, 4)}};
  EXPECT_TRUE(sets == wanted);
  for (const auto& [name, elements] : wanted) EXPECT_FALSE(elements.empty()) << name;
}

TEST(Inp, pinned_text_with_the_materials_of_a_grid_without_labels) {
  Grid grid = test::grid_of({20, 17, 16}, {{.cell = {0, 1, 2}, .material = 7}, {.cell = {1, 1, 2}}},
                            {.material = true});
  grid.spec.origin_world = {-1.5, 0.25, 1.0 / 3};
  grid.spec.voxel_size = glm::dvec3(0.5);
  grid.meta = GridMeta::parse(R"({"units":"mm","options":{"transform":[1,2.5]},)"
                              R"("materials":[{"id":7,"name":"3 стекло\n"}]})");
  const Bytes bytes = cells_encoded(grid, to(Format::kInp));
  EXPECT_EQ(std::string(bytes.begin(), bytes.end()),
            "*HEADING\nvoxeld: 2 voxels, 12 nodes\n** dims 20 17 16\n"
            "** origin -1.5 0.25 0.3333333333333333\n** voxel_size 0.5 0.5 0.5\n** units mm\n"
            "** transform [1,2.5]\n*NODE\n"
            "1,-1.5,0.75,1.3333333333333333\n2,-1,0.75,1.3333333333333333\n"
            "3,-0.5,0.75,1.3333333333333333\n4,-1.5,1.25,1.3333333333333333\n"
            "5,-1,1.25,1.3333333333333333\n6,-0.5,1.25,1.3333333333333333\n"
            "7,-1.5,0.75,1.8333333333333333\n8,-1,0.75,1.8333333333333333\n"
            "9,-0.5,0.75,1.8333333333333333\n10,-1.5,1.25,1.8333333333333333\n"
            "11,-1,1.25,1.8333333333333333\n12,-0.5,1.25,1.8333333333333333\n"
            "*ELEMENT, TYPE=C3D8, ELSET=voxels\n1,1,2,5,4,7,8,11,10\n2,2,3,6,5,8,9,12,11\n"
            "** material 7: 3 стекло \n*ELSET, ELSET=material_3________\n1\n");
}

TEST(Inp, names_of_sets_are_short_and_distinct) {
  Grid grid = test::grid_of({8, 8, 8},
                            {{.cell = {0, 0, 0}, .label = 1},
                             {.cell = {1, 0, 0}, .label = 2},
                             {.cell = {2, 0, 0}, .label = 3},
                             {.cell = {3, 0, 0}, .label = 4},
                             {.cell = {4, 0, 0}, .label = 5}},
                            {.label = true});
  const std::string longest(300, 'x');
  grid.meta = GridMeta::parse(R"({"labels":[{"id":1,"name":")" + longest +
                              R"("},{"id":2,"name":")" + longest +
                              R"(y"},{"id":3,"name":"a_4"},{"id":4,"name":"A"},
                              {"id":5,"name":"大"}]})");
  auto sets = inp_sets(inp_blocks_of(cells_encoded(grid, to(Format::kInp))));
  const std::map<std::string, std::vector<int>> wanted = {{std::string(80, 'x'), {1}},
                                                          {std::string(78, 'x') + "_2", {2}},
                                                          {"a_4", {3}},
                                                          {"A", {4}},
                                                          {"label_5", {5}}};
  EXPECT_TRUE(sets == wanted);
}

TEST(Inp, numbers_have_at_most_20_characters) {
  Grid grid = far_cells_grid();
  grid.spec.origin_world = {-0.00012345678901234567, -1.2345678901234567e-5, 1e10 / 3};
  grid.spec.voxel_size = glm::dvec3(1e-3 / 3);
  expect_mesh_of(grid, inp_mesh(inp_blocks_of(cells_encoded(grid, to(Format::kInp)))), 1e-2);
}

TEST(Inp, a_grid_without_voxels_has_no_nodes_and_no_elements) {
  const Bytes bytes = cells_encoded(Grid(), to(Format::kInp));
  EXPECT_EQ(std::string(bytes.begin(), bytes.end()),
            "*HEADING\nvoxeld: 0 voxels, 0 nodes\n** dims 1 1 1\n** origin 0 0 0\n"
            "** voxel_size 1 1 1\n*NODE\n*ELEMENT, TYPE=C3D8, ELSET=voxels\n");
}

TEST(Hexahedra, nodes_inside_full_nodes_and_at_the_end_of_tiles_are_numbered) {
  Grid grid;
  grid.spec.dims = {264, 256, 256};
  SparseTile& tile = grid.tiles.emplace_back();
  tile.full = {{morton_encode(28, 28, 28), 2}};  // 32 cells, up to the tile's end
  const std::vector<InpBlock> blocks = inp_blocks_of(cells_encoded(grid, to(Format::kInp)));
  const HexMesh mesh = inp_mesh(blocks);
  EXPECT_EQ(mesh.points.size(), 33U * 33 * 33);
  expect_mesh_of(grid, mesh, 0);
}

}  // namespace
}  // namespace voxeld
