// Makes the containers that the tests of the page's decoder read, with what the C++ code says of
// them.
//
//   voxeld_web_containers DIRECTORY
//
// NAME.voxg is a container, NAME.tables its tables by server/render (the layout is below), and
// list.json names the containers and, for each byte of some of them changed in three ways, whether
// the C++ decoder refuses the result and with which text.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "proto/container/grid_format.h"
#include "server/grid/grid.h"
#include "server/render/packed_grid.h"
#include "tests/unit/proto/tile_maker.h"

namespace voxeld {
namespace {

using nlohmann::json;
using Bytes = std::vector<uint8_t>;

// The tables: u32 count and words, for each of nodes, bricks, colours, normals, hull (i32 x, y, z),
// facts (i32: occupied_min, occupied_max, whether there is a full_color, and its R, G, B), and the
// f64 luminance.
class TableFile {
 public:
  explicit TableFile(const std::filesystem::path& path) : file_(path, std::ios::binary) {}

  template <typename T>
  void add(std::span<const T> words) {
    static_assert(sizeof(T) == 4);
    const auto count = static_cast<uint32_t>(words.size());
    write(&count, sizeof count);
    write(words.data(), words.size_bytes());
  }
  void add(double number) { write(&number, sizeof number); }
  bool good() { return file_.flush().good(); }

 private:
  void write(const void* data, size_t size) {
    file_.write(static_cast<const char*>(data), static_cast<std::streamsize>(size));
  }
  std::ofstream file_;
};

bool write_tables(const std::filesystem::path& path, const Bytes& container) {
  const auto grid = grid_from_container(container);
  if (!grid) return false;
  const auto packed = pack_grid(*grid);
  if (!packed) return false;
  TableFile file(path);
  for (const auto* words : {&packed->nodes, &packed->bricks, &packed->colors, &packed->normals}) {
    file.add(std::span<const uint32_t>(*words));
  }
  std::vector<int32_t> hull;
  for (const glm::ivec3& p : packed->hull) hull.insert(hull.end(), {p.x, p.y, p.z});
  file.add(std::span<const int32_t>(hull));
  std::vector<int32_t> facts;
  for (const glm::ivec3& p : {packed->occupied_min, packed->occupied_max}) {
    facts.insert(facts.end(), {p.x, p.y, p.z});
  }
  facts.push_back(packed->full_color ? 1 : 0);
  for (size_t c = 0; c < 3; ++c) facts.push_back(packed->full_color ? (*packed->full_color)[c] : 0);
  file.add(std::span<const int32_t>(facts));
  file.add(packed->luminance);
  return file.good();
}

// The C++ decoder's text; empty if it takes the container.
std::string refusal_of(const Bytes& bytes) {
  const auto reader = GridReader::open(bytes);
  if (!reader) return reader.error().message();
  const auto tiles = reader->decode_tiles();
  return tiles ? "" : tiles.error().message();
}

// Each byte changed: one bit, another one, and all of them.
json changes_of(const Bytes& good) {
  json changes = json::array();
  for (size_t at = 0; at < good.size(); ++at) {
    for (const unsigned by : {1u << (at % 8), 1u << (at * 5 % 8), 255u}) {
      Bytes bytes = good;
      bytes[at] = static_cast<uint8_t>(bytes[at] ^ by);
      changes.push_back({at, by, refusal_of(bytes)});
    }
  }
  return changes;
}

GridHeader header_of(const std::array<int32_t, 3>& dims, const ChannelSet& channels) {
  GridHeader header;
  header.dims = dims;
  header.origin = {-1.5, 0.25, 1e4};
  header.voxel_size = {0.5, 0.5, 0.125};
  header.channels = channels;
  header.meta_json = R"({"units":"mm"})";
  return header;
}

class Maker {
 public:
  explicit Maker(std::filesystem::path directory) : directory_(std::move(directory)) {
    std::filesystem::create_directories(directory_);
  }

  // Returns the container; `with_changes` for small ones.
  Bytes add(const std::string& name, const GridHeader& header, std::span<const SparseTile> tiles,
            bool with_changes = false) {
    const auto bytes = encode_grid(header, tiles);
    if (!bytes) {
      std::cerr << name << ": " << bytes.error().message() << "\n";
      is_good_ = false;
      return {};
    }
    std::ofstream file(directory_ / (name + ".voxg"), std::ios::binary);
    file.write(reinterpret_cast<const char*>(bytes->data()),
               static_cast<std::streamsize>(bytes->size()));
    is_good_ = is_good_ && file.flush().good();
    json entry = {{"name", name}};
    if (header.codecs.octree == Codec::kSmall) {
      entry["small"] = true;
    } else {
      is_good_ = is_good_ && write_tables(directory_ / (name + ".tables"), *bytes);
    }
    if (with_changes) entry["changes"] = changes_of(*bytes);
    list_.push_back(std::move(entry));
    return *bytes;
  }

  bool finish() {
    std::ofstream file(directory_ / "list.json");
    file << list_.dump() << "\n";
    return is_good_ && file.flush().good();
  }

 private:
  std::filesystem::path directory_;
  json list_ = json::array();
  bool is_good_ = true;
};

void add_random_grids(Maker& maker) {
  for (uint32_t seed = 0; seed < test::kChannelSets; seed += 3) {
    std::mt19937 random(seed);
    const std::array<int, 3> dims = {1 + test::below(random, 700), 1 + test::below(random, 300),
                                     1 + test::below(random, 300)};
    const ChannelSet channels = channels_of_bits(seed);
    maker.add("random_" + std::to_string(seed), header_of(dims, channels),
              test::tiles_of(test::random_voxels(random, dims, 3000), channels));
  }
}

void add_grids_with_full_nodes(Maker& maker) {
  for (uint32_t seed = 0; seed < 8; ++seed) {
    std::mt19937 random(seed);
    const ChannelSet channels = channels_of_bits(seed * 21);
    std::vector<SparseTile> tiles;
    for (int i = 0; i < 3; ++i) {
      tiles.push_back(test::tile_with_full_nodes(random, channels));
      tiles.back().coord = {i, 2 * i, 1};
    }
    maker.add("full_" + std::to_string(seed), header_of({768, 2048, 512}, channels), tiles);
  }
  SparseTile whole;
  whole.coord = {1, 0, 0};
  whole.full = {{0, kTileLevels}};
  maker.add("whole_tile", header_of({512, 256, 256}, {.color = true, .normal = true}),
            std::span(&whole, 1), true);
}

// A box of which half the voxels of the first tile, and all of the second, have no colour.
void add_half_colored_box(Maker& maker) {
  const ChannelSet channels = {.color = true};
  auto tiles = test::tiles_of(test::box_voxels({240, 1, 2}, {270, 20, 40}), channels);
  for (SparseTile& tile : tiles) {
    const size_t begin = tile.coord[0] == 0 ? tile.color.size() / 2 : 0;
    std::fill(tile.color.begin() + static_cast<std::ptrdiff_t>(begin / 4 * 4), tile.color.end(), 0);
  }
  maker.add("half_colored", header_of({300, 20, 40}, channels), tiles);
}

// A grid, its tiles in two parts, and previews: other voxels, in cells of so many of the grid's.
void add_growing_grid(Maker& maker) {
  std::mt19937 random(6);
  const std::array<int, 3> dims = {700, 500, 301};
  const ChannelSet channels = {.color = true};
  const GridHeader header = header_of(dims, channels);
  auto tiles = test::tiles_of(test::random_voxels(random, dims, 3000), channels);
  std::ranges::sort(tiles, {}, [](const SparseTile& tile) { return tile_order(tile); });
  maker.add("growing", header, tiles);
  maker.add("growing_begin", header, std::span(tiles).first(5));
  maker.add("growing_end", header, std::span(tiles).subspan(5));
  const auto add_preview = [&](const std::string& name, double cells, std::array<int, 3> coarse,
                               std::span<const SparseTile> voxels) {
    GridHeader preview = header_of(coarse, {});
    for (double& edge : preview.voxel_size) edge *= cells;
    maker.add(name, preview, voxels);
  };
  for (const double cells : {8.0, 5.5}) {
    const auto side = [&](size_t c) { return static_cast<int>(std::ceil(dims[c] / cells)); };
    const std::array<int, 3> coarse = {side(0), side(1), side(2)};
    add_preview(cells == 8 ? "preview_8" : "preview_5", cells, coarse,
                test::tiles_of(test::random_voxels(random, coarse, 500), ChannelSet()));
  }
  const SparseTile full = test::tile_with_full_nodes(random, ChannelSet());
  add_preview("preview_2", 2, {256, 256, 256}, std::span(&full, 1));
}

bool make(const std::filesystem::path& directory) {
  Maker maker(directory);
  const ChannelSet both = {.color = true, .normal = true};
  const auto box = test::box_voxels({254, 1, 2}, {259, 4, 3});
  maker.add("two_tiles", header_of({300, 20, 10}, both), test::tiles_of(box, both), true);
  maker.add("empty", header_of({7, 300, 9}, {}), {}, true);
  GridHeader small = header_of({300, 20, 10}, {});
  small.codecs.octree = Codec::kSmall;
  maker.add("small", small, test::tiles_of(box, ChannelSet()));
  add_random_grids(maker);
  add_grids_with_full_nodes(maker);
  add_half_colored_box(maker);
  add_growing_grid(maker);
  // Empty parts of all sizes, and rows that are joined for the hull.
  std::mt19937 random(5);
  maker.add("large", header_of({5000, 2500, 1300}, {.normal = true}),
            test::tiles_of(test::random_voxels(random, {5000, 2500, 1300}, 4000),
                           ChannelSet{.normal = true}));
  return maker.finish();
}

}  // namespace
}  // namespace voxeld

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: voxeld_web_containers DIRECTORY\n";
    return 2;
  }
  return voxeld::make(argv[1]) ? 0 : 1;
}
