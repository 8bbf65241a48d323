// VDB files, read back by a reader made from the description of the format, and pinned bytes.
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "server/formats/formats.h"
#include "server/formats/npy/sample_writers.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld::vdb_test {  // apart from other tests of a unity build
namespace {

using test::to;
using Bytes = std::vector<uint8_t>;
using Cell = std::array<int32_t, 3>;
using Value = std::vector<float>;  // components; ids as they are

struct VdbTree {
  std::string type, map;
  std::map<std::string, Bytes> meta;
  std::array<double, 18> transform{};
  Value background;
  std::map<Cell, Value> active;                    // voxels of leaves
  std::map<std::pair<Cell, int>, Value> tiles;     // active ones: first cell and side
  std::map<std::pair<Cell, int>, Value> inactive;  // likewise, with voxels of leaves
  size_t leaves = 0;

  std::string text(const std::string& name) const {
    const Bytes& bytes = meta.at(name);
    return {bytes.begin(), bytes.end()};
  }
  static const Value* find(const std::map<std::pair<Cell, int>, Value>& values, const Cell& cell) {
    for (const int side : {1, 8, 128, 4096}) {
      const Cell first = {cell[0] / side * side, cell[1] / side * side, cell[2] / side * side};
      if (const auto found = values.find({first, side}); found != values.end()) {
        return &found->second;
      }
    }
    return nullptr;
  }
  // The value of an active voxel; empty: it is not.
  Value active_at(const Cell& cell) const {
    if (const auto found = active.find(cell); found != active.end()) return found->second;
    const Value* const tile = find(tiles, cell);
    return tile == nullptr ? Value() : *tile;
  }
  // The value of a cell, active or not.
  Value at(const Cell& cell) const {
    if (Value value = active_at(cell); !value.empty()) return value;
    const Value* const other = find(inactive, cell);
    return other == nullptr ? background : *other;
  }
  uint64_t active_count() const {
    uint64_t count = active.size();
    for (const auto& [place, value] : tiles) {
      const auto side = static_cast<uint64_t>(place.second);
      count += side * side * side;
    }
    return count;
  }
};

struct VdbFile {
  std::string uuid;
  std::map<std::string, Bytes> meta;
  std::map<std::string, VdbTree> grids;
};

// Reads a file front to back.
class VdbReader {
 public:
  explicit VdbReader(const Bytes& bytes) : bytes_(bytes) {}

  VdbFile read() {
    VdbFile file;
    EXPECT_EQ(number<int64_t>(), 0x56444220);
    EXPECT_EQ(number<uint32_t>(), 224U);
    EXPECT_EQ(number<uint32_t>(), 10U);
    EXPECT_EQ(number<uint32_t>(), 0U);
    EXPECT_EQ(number<uint8_t>(), 1);
    file.uuid = std::string(bytes_.begin() + at_, bytes_.begin() + at_ + 36);
    at_ += 36;
    file.meta = read_meta();
    const auto grids = number<uint32_t>();
    for (uint32_t i = 0; i < grids; ++i) {
      const std::string name = text();
      EXPECT_TRUE(file.grids.emplace(name, read_grid()).second) << name;
      EXPECT_EQ(file.grids.at(name).text("name"), name);
    }
    EXPECT_EQ(static_cast<size_t>(at_), bytes_.size());
    return file;
  }

 private:
  struct Lower {
    Cell cell{};
    std::vector<std::pair<Cell, Bytes>> leaves;  // cell and mask
  };

  template <typename T>
  T number() {
    T value{};
    if (static_cast<size_t>(at_) + sizeof value > bytes_.size()) throw std::out_of_range("vdb");
    std::memcpy(&value, &bytes_[static_cast<size_t>(at_)], sizeof value);
    at_ += static_cast<ptrdiff_t>(sizeof value);
    return value;
  }
  Bytes bytes(size_t count) {
    if (static_cast<size_t>(at_) + count > bytes_.size()) throw std::out_of_range("vdb");
    at_ += static_cast<ptrdiff_t>(count);
    return {bytes_.begin() + at_ - static_cast<ptrdiff_t>(count), bytes_.begin() + at_};
  }
  std::string text() {
    const Bytes chars = bytes(number<uint32_t>());
    return {chars.begin(), chars.end()};
  }
  Cell cell() {
    Cell cell{};
    for (int32_t& c : cell) c = number<int32_t>();
    return cell;
  }
  std::map<std::string, Bytes> read_meta() {
    std::map<std::string, Bytes> meta;
    for (auto count = number<uint32_t>(); count > 0; --count) {
      const std::string name = text();
      text();
      meta[name] = bytes(number<uint32_t>());
    }
    return meta;
  }
  Value value() {
    Value value;
    for (size_t i = 0; i < components_; ++i) {
      value.push_back(is_int_ ? static_cast<float>(number<int32_t>()) : number<float>());
    }
    return value;
  }
  static bool bit(const Bytes& mask, size_t i) { return (mask[i / 8] >> (i % 8) & 1) != 0; }
  static size_t ones(const Bytes& mask) {
    size_t count = 0;
    for (size_t i = 0; i < 8 * mask.size(); ++i) count += bit(mask, i) ? 1 : 0;
    return count;
  }

  // The values of a node's entries; those of children are not told.
  std::vector<Value> values(const Bytes& children, const Bytes& active) {
    const auto code = number<int8_t>();
    EXPECT_TRUE(code == 0 || code == 1 || code == 3);
    const Bytes select = code == 3 ? bytes(active.size()) : Bytes(active.size(), 0);
    const size_t raw_bytes = ones(active) * components_ * 4;
    const auto length = number<int64_t>();
    Bytes raw = bytes(static_cast<size_t>(length < 0 ? -length : length));
    if (length > 0) {
      Bytes inflated(raw_bytes + 1);
      uLongf out = inflated.size();
      EXPECT_EQ(uncompress(inflated.data(), &out, raw.data(), raw.size()), Z_OK);
      inflated.resize(out);
      raw = inflated;
    }
    EXPECT_EQ(raw.size(), raw_bytes);
    VdbReader samples(raw);
    samples.components_ = components_;
    samples.is_int_ = is_int_;
    std::vector<Value> all;
    Value minus = background_;
    for (float& c : minus) c = -c;
    for (size_t i = 0; i < 8 * active.size(); ++i) {
      const bool is_minus = code == 1 || (code == 3 && !bit(select, i));
      all.push_back(bit(active, i) ? samples.value() : is_minus ? minus : background_);
      EXPECT_FALSE(bit(active, i) && bit(children, i));
    }
    return all;
  }

  static Cell entry(const Cell& node, size_t i, size_t side, int entry_cells) {
    const std::array<size_t, 3> at = {i / side / side, i / side % side, i % side};
    Cell cell = node;
    for (size_t c = 0; c < 3; ++c) cell[c] += static_cast<int>(at[c]) * entry_cells;
    return cell;
  }
  // An internal node; calls child(cell) for its children.
  template <typename Child>
  void node(VdbTree& tree, const Cell& first, size_t side, int entry_cells, Child&& child) {
    const Bytes children = bytes(side * side * side / 8), active = bytes(side * side * side / 8);
    const std::vector<Value> all = values(children, active);
    for (size_t i = 0; i < all.size(); ++i) {
      const Cell cell = entry(first, i, side, entry_cells);
      if (bit(active, i)) {
        EXPECT_TRUE(tree.tiles.emplace(std::pair(cell, entry_cells), all[i]).second);
      } else if (!bit(children, i)) {
        if (all[i] != background_) tree.inactive[{cell, entry_cells}] = all[i];
      }
    }
    for (size_t i = 0; i < all.size(); ++i) {
      if (bit(children, i)) child(entry(first, i, side, entry_cells));
    }
  }

  VdbTree read_grid() {
    VdbTree tree;
    tree.type = text();
    EXPECT_EQ(text(), "");
    const auto grid_at = number<int64_t>(), leaves_at = number<int64_t>(), end = number<int64_t>();
    EXPECT_EQ(at_, grid_at);
    EXPECT_EQ(number<uint32_t>(), 3U);
    tree.meta = read_meta();
    tree.map = text();
    for (double& d : tree.transform) d = number<double>();
    EXPECT_EQ(number<uint32_t>(), 1U);  // buffers
    components_ = tree.type == "Tree_vec3s_5_4_3" ? 3 : 1;
    is_int_ = tree.type == "Tree_int32_5_4_3";
    read_topology(tree);
    EXPECT_EQ(at_, leaves_at);
    read_leaves(tree);
    EXPECT_EQ(at_, end);
    return tree;
  }

  void read_topology(VdbTree& tree) {
    background_ = tree.background = value();
    leaves_.clear();
    const auto tiles = number<uint32_t>(), children = number<uint32_t>();
    for (uint32_t i = 0; i < tiles; ++i) {
      const Cell first = cell();
      tree.inactive[{first, 4096}] = value();
      EXPECT_EQ(number<uint8_t>(), 0);
    }
    Cell before{-1, -1, -1};
    for (uint32_t i = 0; i < children; ++i) {
      const Cell upper = cell();
      EXPECT_LT(before, upper);
      before = upper;
      node(tree, upper, 32, 128, [&](const Cell& lower) {
        std::vector<Cell> cells;
        node(tree, lower, 16, 8, [&](const Cell& leaf) { cells.push_back(leaf); });
        for (const Cell& leaf : cells) leaves_.emplace_back(leaf, bytes(64));
      });
    }
  }

  void read_leaves(VdbTree& tree) {
    tree.leaves = leaves_.size();
    for (const auto& [first, mask] : leaves_) {
      EXPECT_EQ(bytes(64), mask);
      const std::vector<Value> all = values(Bytes(64, 0), mask);
      for (size_t i = 0; i < all.size(); ++i) {
        const Cell cell = entry(first, i, 8, 1);
        if (bit(mask, i)) {
          EXPECT_TRUE(tree.active.emplace(cell, all[i]).second);
        } else if (all[i] != background_) {
          tree.inactive[{cell, 1}] = all[i];
        }
      }
    }
  }

  const Bytes& bytes_;
  ptrdiff_t at_ = 0;
  size_t components_ = 1;
  bool is_int_ = false;
  Value background_;
  std::vector<std::pair<Cell, Bytes>> leaves_;
};

VdbFile encoded(const Grid& grid) {
  const auto bytes = encode(grid, to(Format::kVdb));
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return VdbReader(*bytes).read();
}

std::vector<std::string> names_of(const VdbFile& file) {
  std::vector<std::string> names;
  for (const auto& [name, tree] : file.grids) names.push_back(name);
  return names;
}

int64_t count_of(const VdbTree& tree) {
  int64_t count = 0;
  std::memcpy(&count, tree.meta.at("file_voxel_count").data(), sizeof count);
  return count;
}

Cell cell_of(const Bytes& bytes) {
  Cell cell{};
  std::memcpy(cell.data(), bytes.data(), sizeof cell);
  return cell;
}

// Checks count and box of the active voxels.
void check_facts(const VdbTree& tree) {
  EXPECT_EQ(count_of(tree), static_cast<int64_t>(tree.active_count()));
  Cell min{INT32_MAX, INT32_MAX, INT32_MAX}, max{INT32_MIN, INT32_MIN, INT32_MIN};
  const auto add = [&](const Cell& cell, int side) {
    for (size_t c = 0; c < 3; ++c) {
      min[c] = std::min(min[c], cell[c]);
      max[c] = std::max(max[c], cell[c] + side - 1);
    }
  };
  for (const auto& [cell, value] : tree.active) add(cell, 1);
  for (const auto& [place, value] : tree.tiles) add(place.first, place.second);
  EXPECT_EQ(cell_of(tree.meta.at("file_bbox_min")), min);
  EXPECT_EQ(cell_of(tree.meta.at("file_bbox_max")), max);
}

TEST(Vdb, every_channel_is_a_grid_with_the_voxels_values) {
  std::mt19937 random(3);
  const ChannelSet channels = channels_of_bits(~uint32_t{0});
  const auto voxels = test::random_voxels(random, {300, 200, 150}, 4000);
  Grid grid = test::grid_of({300, 200, 150}, voxels, channels);
  grid.spec.voxel_size = glm::dvec3(0.25);
  const VdbFile file = encoded(grid);
  EXPECT_EQ(names_of(file), (std::vector<std::string>{"alpha", "color", "density", "label",
                                                      "material", "normal", "surface"}));
  for (const auto& [name, tree] : file.grids) {
    EXPECT_EQ(tree.active_count(), grid.voxel_count()) << name;
    check_facts(tree);
  }
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int32_t x, int32_t y, int32_t z, size_t i) {
      const Cell cell = {x, y, z};
      const auto is = [&](const char* name, const Value& value) {
        EXPECT_EQ(file.grids.at(name).active_at(cell), value) << name;
      };
      is("density", {static_cast<float>(tile.coverage[i]) / 255});
      is("surface", {static_cast<float>(tile.distance[i]) / 128 / 4});
      is("color", {linear_from_srgb(tile.color[4 * i]), linear_from_srgb(tile.color[4 * i + 1]),
                   linear_from_srgb(tile.color[4 * i + 2])});
      is("alpha", {static_cast<float>(tile.color[4 * i + 3]) / 255});
      is("normal", {static_cast<float>(tile.normal[3 * i]) / 127,
                    static_cast<float>(tile.normal[3 * i + 1]) / 127,
                    static_cast<float>(tile.normal[3 * i + 2]) / 127});
      is("material", {static_cast<float>(tile.material[i])});
      is("label", {static_cast<float>(tile.label[i])});
    });
  }
}

TEST(Vdb, types_classes_names_and_units_are_told) {
  Grid grid = test::random_grid(1, {20, 20, 20}, 50, true, true);
  grid.channels = channels_of_bits(~uint32_t{0});
  for (SparseTile& tile : grid.tiles) resize_channels(tile, grid.channels);
  grid.meta = GridMeta::parse(
      R"({"units":"mm","labels":[{"id":2,"name":"wood"},{"id":1,"name":"brick"}]})");
  const VdbFile file = encoded(grid);
  EXPECT_EQ(std::string(file.meta.at("units").begin(), file.meta.at("units").end()), "mm");
  EXPECT_EQ(std::string(file.meta.at("meta").begin(), file.meta.at("meta").end()),
            grid.meta.text());
  EXPECT_EQ(cell_of(file.meta.at("dims")), (Cell{20, 20, 20}));
  const auto check = [&](const char* name, const char* type, const char* of) {
    EXPECT_EQ(file.grids.at(name).type, type) << name;
    EXPECT_EQ(file.grids.at(name).text("class"), of) << name;
  };
  check("density", "Tree_float_5_4_3", "fog volume");
  check("surface", "Tree_float_5_4_3", "unknown");  // voxels are no cubes, and fill is unknown
  check("color", "Tree_vec3s_5_4_3", "unknown");
  check("normal", "Tree_vec3s_5_4_3", "unknown");
  check("label", "Tree_int32_5_4_3", "unknown");
  EXPECT_EQ(file.grids.at("color").text("vector_type"), "invariant");
  EXPECT_EQ(file.grids.at("normal").text("vector_type"), "covariant normalize");
  EXPECT_EQ(file.grids.at("label").text("names"), R"({"1":"brick","2":"wood"})");
  EXPECT_FALSE(file.grids.at("material").meta.contains("names"));
}

TEST(Vdb, an_index_is_the_centre_of_its_cell) {
  Grid grid = test::random_grid(1, {20, 20, 20}, 5, false, false);  // far away, voxels no cubes
  const VdbTree boxes = encoded(grid).grids.at("density");
  EXPECT_EQ(boxes.map, "ScaleTranslateMap");
  const std::array<double, 18> expected = {
      -1.25, 0.375, 1e10 + 0.0625, 0.5, 0.25, 0.125, 0.5, 0.25, 0.125, 2, 4, 8, 4, 16, 64, 1, 2, 4};
  EXPECT_EQ(boxes.transform, expected);
  grid.spec.voxel_size = glm::dvec3(0.5);
  const VdbTree cubes = encoded(grid).grids.at("density");
  EXPECT_EQ(cubes.map, "UniformScaleTranslateMap");
  EXPECT_EQ(cubes.transform[2], 1e10 + 0.25);
  EXPECT_EQ(cubes.transform[5], 0.5);
}

TEST(Vdb, a_grid_without_voxels_has_a_background_alone) {
  Grid grid;
  grid.spec.dims = {100, 100, 100};
  grid.channels = {.color = true, .distance = true};
  const VdbFile file = encoded(grid);
  EXPECT_EQ(names_of(file), (std::vector<std::string>{"color", "density", "surface"}));
  for (const auto& [name, tree] : file.grids) {
    EXPECT_EQ(tree.active_count(), 0U);
    EXPECT_TRUE(tree.inactive.empty());
    check_facts(tree);
  }
}

TEST(Vdb, full_nodes_are_tiles) {
  const ChannelSet channels = {.color = true, .normal = true, .label = true};
  Grid grid = test::grid_of(
      {600, 256, 256}, {{.cell = {300, 1, 2}, .color = {255, 0, 0, 255}, .label = 9}}, channels);
  SparseTile& tile = grid.tiles[0];
  tile.full = {{morton_encode(0, 8, 0), 2}, {morton_encode(16, 16, 16), 4}};
  const VdbFile file = encoded(grid);
  const std::map<std::string, Value> inner = {
      {"density", {1}}, {"color", {1, 0, 0}}, {"normal", {0, 0, 0}}, {"label", {0}}};
  for (const auto& [name, value] : inner) {
    const VdbTree& tree = file.grids.at(name);
    EXPECT_EQ(tree.leaves, 1U);
    EXPECT_EQ(tree.tiles.size(), 64U + 1);
    EXPECT_EQ(tree.active_count(), 1U + 32 * 32 * 32 + 128 * 128 * 128);
    check_facts(tree);
    for (const Cell& cell : {Cell{256, 64, 0}, {287, 95, 31}, {384, 128, 128}, {511, 255, 255}}) {
      EXPECT_EQ(tree.active_at(cell), value);
    }
  }
  EXPECT_EQ(file.grids.at("label").at({300, 1, 2}), Value{9});
}

TEST(Vdb, voxels_without_a_colour_have_the_mean_and_are_opaque) {
  Grid grid = test::grid_of({8, 8, 8},
                            {{.cell = {1, 0, 0}, .color = {0, 255, 0, 255}}, {.cell = {2, 0, 0}}},
                            {.color = true});
  const float green = linear_from_srgb(mean_color(grid)[1]);
  EXPECT_EQ(encoded(grid).grids.at("color").at({2, 0, 0}), (Value{0, green, 0}));
  EXPECT_FALSE(encoded(grid).grids.contains("alpha"));
  grid.tiles[0].color[3] = 51;
  const VdbFile file = encoded(grid);
  EXPECT_EQ(file.grids.at("alpha").at({1, 0, 0}), Value{51.0F / 255});
  EXPECT_EQ(file.grids.at("alpha").at({2, 0, 0}), Value{1});
}

TEST(Vdb, a_brick_of_equal_values_is_a_tile) {
  std::vector<test::TestVoxel> voxels;
  for (int i = 0; i < 512; ++i) {
    voxels.push_back({.cell = {8 + i % 8, i / 8 % 8, i / 64},
                      .color = {9, 9, 9, 255},
                      .label = static_cast<uint16_t>(i == 77 ? 2 : 1)});
  }
  const VdbFile file = encoded(test::grid_of({16, 8, 8}, voxels, {.color = true, .label = true}));
  EXPECT_EQ(file.grids.at("density").tiles, (decltype(VdbTree::tiles){{{{8, 0, 0}, 8}, {1}}}));
  EXPECT_EQ(file.grids.at("color").leaves, 0U);
  EXPECT_EQ(file.grids.at("label").leaves, 1U);
  EXPECT_EQ(file.grids.at("label").active.size(), 512U);
}

TEST(Vdb, a_whole_tile_of_the_grid_and_bricks_of_one_value_are_tiles_of_the_upper_node) {
  Grid grid;
  grid.spec.dims = {512, 256, 256};
  SparseTile& whole = grid.tiles.emplace_back();
  whole.full = {{0, kTileLevels}};
  SparseTile& bricks = grid.tiles.emplace_back();
  bricks.coord = {1, 0, 0};
  grid.channels = {.coverage = true};
  for (uint32_t i = 0; i < 4096; ++i) {
    bricks.brick_morton.push_back(i);
    bricks.masks.emplace_back().words.fill(~uint64_t{0});
  }
  bricks.coverage.assign(size_t{4096} * 512, 255);
  const VdbTree tree = encoded(grid).grids.at("density");
  EXPECT_EQ(tree.tiles.size(), 9U);
  EXPECT_EQ(tree.leaves, 0U);
  EXPECT_EQ(count_of(tree), 9 * 128 * 128 * 128);
}

// The distances of a sphere, in 1/kDistanceSteps voxel, at the cells near it.
Grid band_of_sphere(const Cell& dims, const std::array<double, 3>& center, double radius) {
  std::vector<test::TestVoxel> voxels;
  for (int x = 0; x < dims[0]; ++x) {
    for (int y = 0; y < dims[1]; ++y) {
      for (int z = 0; z < dims[2]; ++z) {
        const double dx = x + 0.5 - center[0], dy = y + 0.5 - center[1], dz = z + 0.5 - center[2];
        const double distance = std::sqrt(dx * dx + dy * dy + dz * dz) - radius;
        if (std::abs(distance) > 2) continue;
        voxels.push_back(
            {.cell = {x, y, z}, .distance = static_cast<int16_t>(std::lround(distance * 128))});
      }
    }
  }
  Grid grid = test::grid_of(dims, voxels, {.distance = true});
  grid.spec.voxel_size = glm::dvec3(0.5);
  grid.meta = GridMeta::parse(R"({"options":{"fill":"band"}})");
  return grid;
}

TEST(Vdb, a_band_without_distances_has_its_voxels_as_density) {
  Grid grid = test::grid_of({8, 8, 8}, {{.cell = {1, 2, 3}}}, ChannelSet{});
  grid.meta = GridMeta::parse(R"({"options":{"fill":"band"}})");
  const VdbFile file = encoded(grid);
  ASSERT_TRUE(file.grids.contains("density"));
  EXPECT_EQ(file.grids.at("density").active.size(), 1U);
}

TEST(Vdb, cells_inside_a_band_are_minus_the_background) {
  const Cell dims = {150, 140, 160};
  for (const double x : {75.0, 0.0, 150.0}) {  // inside, and cut by the grid
    const std::array<double, 3> center = {x, 66, 82};
    const VdbFile file = encoded(band_of_sphere(dims, center, 60));
    EXPECT_EQ(names_of(file), (std::vector<std::string>{"surface"}));
    const VdbTree& tree = file.grids.at("surface");
    EXPECT_EQ(tree.text("class"), "level set");
    const float background = tree.background[0];
    EXPECT_GT(background, 0.98F);
    check_facts(tree);
    size_t inside = 0;
    for (int i = 0; i < dims[0]; i += 3) {
      for (int j = 0; j < dims[1]; j += 3) {
        for (int k = 0; k < dims[2]; ++k) {
          const double dx = i + 0.5 - center[0], dy = j + 0.5 - center[1], dz = k + 0.5 - center[2];
          const double distance = std::sqrt(dx * dx + dy * dy + dz * dz) - 60;
          const float value = tree.at({i, j, k})[0];
          ASSERT_NEAR(value, std::clamp(distance / 2, -1.0, 1.0), 1.0 / 64)
              << i << " " << j << " " << k;
          inside += value == -background ? 1 : 0;
        }
      }
    }
    EXPECT_GT(inside, 20'000U);
    for (const auto& [place, value] : tree.inactive) {  // nothing beyond the grid
      for (size_t c = 0; c < 3; ++c) EXPECT_LT(place.first[c], dims[c]);
    }
  }
}

TEST(Vdb, a_tile_of_the_root_between_two_parts_of_a_band_is_inside) {
  Grid grid = test::grid_of(
      {8, 8, 14000},
      {{.cell = {0, 0, 100}, .distance = -64}, {.cell = {0, 0, 12300}, .distance = 64}},
      {.distance = true});
  grid.meta = GridMeta::parse(R"({"options":{"fill":"band"}})");
  grid.spec.voxel_size = glm::dvec3(1);
  const VdbTree tree = encoded(grid).grids.at("surface");
  EXPECT_EQ(tree.at({0, 0, 4000}), Value{-0.5});
  EXPECT_EQ(tree.inactive.count({{0, 0, 4096}, 4096}), 1U);
  EXPECT_EQ(tree.inactive.count({{0, 0, 8192}, 4096}), 1U);
  EXPECT_EQ(tree.at({0, 0, 13000}), Value{0.5});
}

TEST(Vdb, nodes_above_4096_cells_are_in_order) {
  std::vector<test::TestVoxel> voxels;
  for (const int x : {0, 4095, 4096, 12300}) {
    for (const int y : {5, 8000}) voxels.push_back({.cell = {x, y, 16000 - y}});
  }
  const Grid grid = test::grid_of({16384, 16384, 16384}, voxels, {});
  const VdbTree tree = encoded(grid).grids.at("density");
  EXPECT_EQ(tree.active.size(), voxels.size());
  for (const test::TestVoxel& voxel : voxels) {
    const auto [x, y, z] = voxel.cell;
    EXPECT_EQ(tree.active.count({x, y, z}), 1U);
  }
}

TEST(Vdb, equal_grids_give_equal_bytes_and_others_another_uuid) {
  const Grid grid = test::random_grid(5, {300, 270, 40}, 9000, true, true);
  EXPECT_EQ(encode(grid, to(Format::kVdb)).value(), encode(grid, to(Format::kVdb)).value());
  const std::string uuid = encoded(grid).uuid;
  EXPECT_EQ(uuid[8], '-');
  EXPECT_EQ(uuid[14], '8');
  EXPECT_NE(uuid, encoded(test::random_grid(6, {300, 270, 40}, 9000, true, true)).uuid);
}

TEST(Vdb, pinned_bytes_of_one_voxel) {
  Grid grid = test::grid_of({8, 8, 8}, {{.cell = {0, 0, 1}}}, {});
  const Bytes bytes = encode(grid, to(Format::kVdb)).value();
  // The leaf: its mask, code 0, minus the raw bytes, and 1.0.
  Bytes leaf(64 + 1 + 8 + 4);
  leaf[0] = 2;
  const int64_t length = -4;
  std::memcpy(&leaf[65], &length, sizeof length);
  leaf[75] = 0x80;
  leaf[76] = 0x3f;
  ASSERT_GT(bytes.size(), leaf.size());
  EXPECT_EQ(Bytes(bytes.end() - static_cast<ptrdiff_t>(leaf.size()), bytes.end()), leaf);
}

}  // namespace
}  // namespace voxeld::vdb_test
