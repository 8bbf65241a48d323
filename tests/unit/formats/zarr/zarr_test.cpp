// Zarr stores against the arrays of npy, read by what the specifications say.
#include <gtest/gtest.h>
#include <unistd.h>
#include <zlib.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "server/base/disk/file.h"
#include "server/formats/formats.h"
#include "server/grid/level.h"
#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/sample_frames.h"

namespace voxeld {
namespace {

using nlohmann::json;
using Bytes = std::vector<uint8_t>;
using Members = std::map<std::string, Bytes>;

constexpr size_t kChunkSide = 64;
constexpr size_t kChunkCells = kChunkSide * kChunkSide * kChunkSide;

uint64_t number(const Bytes& bytes, size_t at, size_t count) {
  uint64_t value = 0;
  for (size_t i = 0; i < count; ++i) value |= uint64_t{bytes.at(at + i)} << (8 * i);
  return value;
}

// The members of an archive, all of which are stored.
Members members_of(const Bytes& zip) {
  Members members;
  for (size_t at = 0; number(zip, at, 4) == 0x04034b50;) {
    EXPECT_EQ(number(zip, at + 8, 2), 0U) << "a deflated member";
    const size_t name = number(zip, at + 26, 2), extra = number(zip, at + 28, 2);
    const std::string key(zip.begin() + static_cast<ptrdiff_t>(at + 30),
                          zip.begin() + static_cast<ptrdiff_t>(at + 30 + name));
    const size_t bytes = number(zip, at + 30 + name + 12, 8);
    const auto begin = zip.begin() + static_cast<ptrdiff_t>(at + 30 + name + extra);
    EXPECT_TRUE(members.emplace(key, Bytes(begin, begin + static_cast<ptrdiff_t>(bytes))).second)
        << key;
    at += 30 + name + extra + bytes;
  }
  return members;
}

Bytes inflated_chunk(const Bytes& gzip, size_t bytes) {
  Bytes out(bytes + 1);
  z_stream z{};
  EXPECT_EQ(inflateInit2(&z, 15 + 16), Z_OK);
  z.next_in = const_cast<uint8_t*>(gzip.data());
  z.avail_in = static_cast<uInt>(gzip.size());
  z.next_out = out.data();
  z.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(inflate(&z, Z_FINISH), Z_STREAM_END);
  EXPECT_EQ(z.avail_in, 0U);
  out.resize(z.total_out);
  inflateEnd(&z);
  EXPECT_EQ(out.size(), bytes);
  return out;
}

// The array below `prefix`, its absent chunks filled with `fill`. Fails on chunks outside of it.
Bytes array_of(const Members& members, const std::string& prefix, const glm::ivec3& dims,
               const Bytes& fill, bool has_components) {
  const size_t cell = fill.size();
  const size_t nx = static_cast<size_t>(dims.x), ny = static_cast<size_t>(dims.y),
               nz = static_cast<size_t>(dims.z);
  Bytes all;
  for (size_t i = 0; i < nx * ny * nz; ++i) all.insert(all.end(), fill.begin(), fill.end());
  size_t used = 0;
  for (size_t z = 0; z < nz; z += kChunkSide) {
    for (size_t y = 0; y < ny; y += kChunkSide) {
      for (size_t x = 0; x < nx; x += kChunkSide) {
        const std::string key = prefix + std::to_string(z / kChunkSide) + "/" +
                                std::to_string(y / kChunkSide) + "/" +
                                std::to_string(x / kChunkSide) + (has_components ? "/0" : "");
        const auto found = members.find(key);
        if (found == members.end()) continue;
        ++used;
        const Bytes chunk = inflated_chunk(found->second, kChunkCells * cell);
        for (size_t i = 0; i < kChunkCells; ++i) {
          const size_t cx = x + i % kChunkSide, cy = y + i / kChunkSide % kChunkSide,
                       cz = z + i / kChunkSide / kChunkSide;
          if (cx >= nx || cy >= ny || cz >= nz) {
            EXPECT_EQ(std::memcmp(&chunk[i * cell], fill.data(), cell), 0) << key << " " << i;
            continue;
          }
          std::memcpy(&all[((cz * ny + cy) * nx + cx) * cell], &chunk[i * cell], cell);
        }
      }
    }
  }
  const auto begin = members.lower_bound(prefix);
  size_t chunks = 0;
  for (auto at = begin; at != members.end() && at->first.starts_with(prefix); ++at) {
    chunks += at->first[prefix.size()] != '.' && at->first.find("json") == std::string::npos;
  }
  EXPECT_EQ(used, chunks) << prefix;
  return all;
}

json document(const Members& members, const std::string& path) {
  const auto found = members.find(path);
  EXPECT_NE(found, members.end()) << path;
  return found == members.end() ? json() : json::parse(found->second);
}

Bytes npy_samples(const Grid& grid, std::optional<Channel> channel) {
  OutputOptions options;
  options.axes = AxisOrder::kZyx;
  return test::read_npy(test::npy_of(grid, channel, options)).data;
}

Grid zarr_sample() {
  return test::grid_of({130, 67, 65},
                       {{{0, 0, 0}, {1, 2, 3, 4}, {0, 127, 0}},
                        {{63, 63, 63}, {5, 6, 7, 8}, {127, 0, 0}},
                        {{64, 64, 64}, {9, 10, 11, 12}, {0, 0, -127}},
                        {{129, 66, 64}, {13, 14, 15, 16}, {0, -127, 0}}},
                       true, true);
}

Members store_of(const Grid& grid, int version) {
  OutputOptions options = test::to(Format::kZarr);
  options.zarr_version = version;
  const auto bytes = encode(grid, options);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return bytes ? members_of(*bytes) : Members();
}

TEST(Zarr, arrays_of_all_levels_equal_those_of_npy) {
  const Grid grid = zarr_sample();
  for (const int version : {2, 3}) {
    const Members members = store_of(grid, version);
    const std::string chunks = version == 3 ? "/c/" : "/";
    for (int level = 0; level < 3; ++level) {
      Grid coarse = grid;
      if (level > 0) {
        const GridTiles source(grid);
        const LevelTiles tiles(source, level, LevelRule::kAny);
        coarse = tiles.grid();
        for (size_t i = 0; i < tiles.coords().size(); ++i) {
          coarse.tiles.push_back(*tiles.tile(i));
        }
      }
      const std::string name = std::to_string(level);
      EXPECT_EQ(array_of(members, name + chunks, coarse.spec.dims, {0}, false),
                npy_samples(coarse, std::nullopt));
      EXPECT_EQ(array_of(members, "color/" + name + chunks, coarse.spec.dims, Bytes(4), true),
                npy_samples(coarse, Channel::kColor));
      EXPECT_EQ(array_of(members, "normal/" + name + chunks, coarse.spec.dims, Bytes(3), true),
                npy_samples(coarse, Channel::kNormal));
    }
    EXPECT_FALSE(members.contains(version == 3 ? "0/c/0/0/1" : "0/0/0/1")) << "an empty chunk";
    EXPECT_FALSE(members.contains(version == 3 ? "3/zarr.json" : "3/.zarray"));
  }
}

TEST(Zarr, cells_of_full_nodes_are_in_chunks) {
  const Grid grid = test::grid_with_a_full_brick(true, false);
  const Members members = store_of(grid, 3);
  EXPECT_EQ(array_of(members, "0/c/", grid.spec.dims, {0}, false), npy_samples(grid, std::nullopt));
  EXPECT_EQ(array_of(members, "color/0/c/", grid.spec.dims, Bytes(4), true),
            npy_samples(grid, Channel::kColor));
}

TEST(Zarr, documents_place_the_centres_of_the_first_cells) {
  const Members members = store_of(zarr_sample(), 3);
  const json root = document(members, "zarr.json");
  EXPECT_EQ(root["node_type"], "group");
  const json& image = root["attributes"]["ome"]["multiscales"][0];
  EXPECT_EQ(root["attributes"]["ome"]["version"], "0.5");
  EXPECT_EQ(image["axes"][0], (json{{"name", "z"}, {"type", "space"}, {"unit", "millimeter"}}));
  const json& moved = image["datasets"][1]["coordinateTransformations"];
  EXPECT_EQ(moved[0]["scale"], (json{0.25, 0.5, 1.0}));
  EXPECT_EQ(moved[1]["translation"], (json{1e10 + 0.125, 0.5, -1.0}));
  const json array = document(members, "color/0/zarr.json");
  EXPECT_EQ(array["shape"], (json{65, 67, 130, 4}));
  EXPECT_EQ(array["data_type"], "uint8");
  EXPECT_EQ(array["dimension_names"], (json{"z", "y", "x", "c"}));
}

TEST(Zarr, the_time_axis_begins_with_the_first_frame) {
  const std::vector<Grid> grids(3, zarr_sample());
  const auto path =
      std::filesystem::temp_directory_path() / ("unit_formats-zarr-" + std::to_string(getpid()));
  ASSERT_TRUE(
      write_sequence(test::FramesInMemory(grids, 24, 12), test::to(Format::kZarr), path).ok());
  const Members members = members_of(read_file(path).value());
  std::filesystem::remove(path);
  const json root = document(members, "zarr.json");
  const json& image = root["attributes"]["ome"]["multiscales"][0];
  EXPECT_EQ(image["axes"][0], (json{{"name", "t"}, {"type", "time"}, {"unit", "second"}}));
  const json& moved = image["datasets"][0]["coordinateTransformations"];
  EXPECT_EQ(moved[0]["scale"][0], 1.0 / 24);
  EXPECT_EQ(moved[1]["translation"][0], 0.5);
}

TEST(Zarr, version_2_has_its_own_documents) {
  const Members members = store_of(zarr_sample(), 2);
  EXPECT_FALSE(members.contains("zarr.json"));
  const json array = document(members, "1/.zarray");
  EXPECT_EQ(array["shape"], (json{33, 34, 65}));
  EXPECT_EQ(array["dimension_separator"], "/");
  EXPECT_EQ(array["dtype"], "|u1");
  const json all = document(members, ".zmetadata")["metadata"];
  EXPECT_EQ(all["1/.zarray"], array);
  EXPECT_EQ(document(members, ".zattrs")["multiscales"][0]["version"], "0.4");
}

TEST(Zarr, equal_grids_give_equal_bytes) {
  EXPECT_EQ(*encode(zarr_sample(), test::to(Format::kZarr)),
            *encode(zarr_sample(), test::to(Format::kZarr)));
}

}  // namespace
}  // namespace voxeld
