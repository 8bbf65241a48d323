// Writes NanoVDB's .nvdb, version 32.4.2: one segment with the grids of named_grids.h, each of them
// a zlib stream. nano_layout.h has the byte maps of what follows a grid's first 672 bytes.
//
//   segment   u64 magic "NanoVDB0", u32 version, u16 grids, u16 codec 1 (zip); facts of each grid;
//             of each grid u64 bytes of a zlib stream and the stream
//   facts     u64 bytes of the grid, u64 bytes in the file, u64 hash of the name, u64 active
//             voxels, u32 type, u32 class, f64[3] first and last corner of the world box, i32[3]
//             first and last active voxel, f64[3] voxel size, u32 characters of the name and a
//             zero, u32[4] leaves, lower and upper nodes, 1; u32[3] active tiles of these nodes,
//             u16 codec, u16 0, u32 version; name and a zero
//   grid      u64 magic, u32 CRC-32 of the bytes from 16 up to the first upper node, u32 CRC-32 of
//             the CRC-32 of each node as u64 (all ones: there is none); u32 version, u32 flags,
//             u32 0, u32 1 (one grid), u64 bytes of the grid, name in 256 bytes, map, world box,
//             voxel size, u32 class, u32 type, i64 0, u32 0 (no blind data), 20 zeros
//   map       f32[9] matrix, f32[9] inverse, f32[3] translation, f32 1; the same as f64
//   version   major << 21 | minor << 10 | patch
//   flags     2: boxes, 4: minimum and maximum, 8: mean, 16: standard deviation, 32: breadth first
//   type      1: float, 4: int32, 6: three floats
//   class     0: unknown, 1: level set, 2: fog volume
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

#include <libdeflate.h>

#include "server/formats/formats.h"
#include "server/formats/output_file.h"
#include "server/formats/vdb/bytes.h"
#include "server/formats/vdb/grid_values.h"
#include "server/formats/vdb/named_grids.h"
#include "server/formats/vdb/nano_layout.h"
#include "server/formats/vdb/nano_tree.h"
#include "server/formats/vdb/tree_nodes.h"
#include "server/formats/volume/volume_facts.h"
#include "server/formats/zip/deflate_stream.h"

namespace voxeld::vdb {
namespace {

constexpr uint64_t kNanoMagic = 0x304244566f6e614e;
constexpr uint32_t kNanoVersion = 32 << 21 | 4 << 10 | 2;
constexpr uint16_t kNanoZip = 1;
constexpr size_t kNanoNameBytes = 256;
constexpr size_t kNanoUnsummedBytes = 16;  // before those of the first checksum
constexpr uint32_t kNanoNoSum = UINT32_MAX;

enum NanoFlag : uint32_t { kHasBoxes = 2, kHasStatistics = 4 | 8 | 16, kIsBreadthFirst = 32 };

template <typename Value>
constexpr uint32_t nano_type() {
  if constexpr (std::is_same_v<Value, float>) {
    return 1;
  } else if constexpr (std::is_same_v<Value, int32_t>) {
    return 4;
  } else {
    static_assert(std::is_same_v<Value, Vec3s>);
    return 6;
  }
}

// Readers look names up by it: base 67, the byte that a digit shifts out is added to the next one.
uint64_t name_hash(std::string_view name) {
  uint64_t hash = 0;
  for (const char c : name) hash = 67 * hash + (hash >> 56) + static_cast<uint8_t>(c);
  return hash;
}

struct WorldBox {
  glm::dvec3 min{std::numeric_limits<double>::max()};  // of no voxels
  glm::dvec3 max{-std::numeric_limits<double>::max()};
};

// From the index of the first voxel to the one after the last, as NanoVDB's own tools have it: half
// a voxel beyond the voxels' cubes.
WorldBox world_box(const GridSpec& spec, const ActiveVoxels& active) {
  WorldBox box;
  if (active.count == 0) return box;
  const glm::dvec3 sides = voxel_sides(spec), center = volume::first_center(spec);
  for (int c = 0; c < 3; ++c) {
    const auto i = static_cast<size_t>(c);
    box.min[c] = std::fma(sides[c], active.min[i], center[c]);
    box.max[c] = std::fma(sides[c], active.max[i] + 1.0, center[c]);
  }
  return box;
}

template <typename Real>
void put_diagonal(Bytes& out, const glm::dvec3& diagonal) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      put(out, row == column ? static_cast<Real>(diagonal[row]) : Real{0});
    }
  }
}

template <typename Real>
void put_map(Bytes& out, const GridSpec& spec) {
  const glm::dvec3 sides = voxel_sides(spec), center = volume::first_center(spec);
  put_diagonal<Real>(out, sides);
  put_diagonal<Real>(out, 1.0 / sides);
  for (int c = 0; c < 3; ++c) put(out, static_cast<Real>(center[c]));
  put(out, Real{1});
}

// Writes the grids of one file.
class NanoFile {
 public:
  NanoFile(const Grid& grid, OutputFile& file)
      : grid_(grid), order_(grid), names_(names_of_grids(grid)), file_(file) {}

  Status write() {
    Bytes head;
    put(head, kNanoMagic);
    put(head, kNanoVersion);
    put(head, static_cast<uint16_t>(names_.size()));
    put(head, kNanoZip);
    const size_t fixed = head.size();
    for (const std::string& name : names_) head.resize(head.size() + kFactsBytes + name.size() + 1);
    VOXELD_TRY(file_.append(head));
    head.resize(fixed);
    for (const std::string& name : names_) {
      const NamedGrid named = named_grid(grid_, name);
      VOXELD_TRY(std::visit(
          [&](const auto& values) { return write_grid(name, named.volume_class, *values, head); },
          named.values));
    }
    return file_.replace(0, head);
  }

 private:
  static constexpr size_t kFactsBytes = 176;

  // Appends the grid's facts to `head`.
  template <typename Value>
  Status write_grid(const std::string& name, VolumeClass of, const GridValues<Value>& values,
                    Bytes& head) {
    const TreeNodes<Value> nodes(order_, values);
    const NanoTree<Value> tree(nodes);
    VOXELD_TRY(check_nano_leaves(tree.counts().leaves));
    const uint64_t begin = file_.size();
    VOXELD_TRY(file_.append(bytes_of(uint64_t{0})));
    DeflateStream stream(file_, DeflateStream::Frame::kZlib);
    VOXELD_TRY(stream.begin_without(kNanoGridBytes + tree.head_bytes()));
    VOXELD_ASSIGN(const uint32_t node_sum, tree.write_nodes(stream));

    Bytes grid;
    put(grid, kNanoMagic);
    put(grid, uint64_t{0});
    put_grid_facts(grid, name, kNanoGridBytes + tree.bytes(), nodes.active());
    put(grid, static_cast<uint32_t>(of));
    put(grid, nano_type<Value>());
    grid.resize(kNanoGridBytes);
    const Bytes tree_head = tree.head();
    grid.insert(grid.end(), tree_head.begin(), tree_head.end());
    const std::array<uint32_t, 2> sums = {
        libdeflate_crc32(0, &grid[kNanoUnsummedBytes], grid.size() - kNanoUnsummedBytes),
        tree.counts().uppers > 0 ? node_sum : kNanoNoSum};
    std::memcpy(&grid[sizeof kNanoMagic], sums.data(), sizeof sums);
    VOXELD_TRY(stream.finish(grid));
    const uint64_t bytes = file_.size() - begin;
    VOXELD_TRY(file_.replace(begin, bytes_of(bytes - sizeof bytes)));
    put_facts<Value>(head, name, of, tree, nodes.active(), bytes);
    return {};
  }

  // From the version to the voxel size.
  void put_grid_facts(Bytes& out, const std::string& name, uint64_t bytes,
                      const ActiveVoxels& active) const {
    put(out, kNanoVersion);
    put(out, uint32_t{kHasStatistics | kIsBreadthFirst} | (active.count > 0 ? kHasBoxes : 0U));
    put(out, uint32_t{0});
    put(out, uint32_t{1});
    put(out, bytes);
    const size_t name_end = out.size() + kNanoNameBytes;
    out.insert(out.end(), name.begin(), name.end());
    out.resize(name_end);
    put_map<float>(out, grid_.spec);
    put_map<double>(out, grid_.spec);
    put(out, world_box(grid_.spec, active));
    put(out, voxel_sides(grid_.spec));
  }

  template <typename Value>
  void put_facts(Bytes& out, const std::string& name, VolumeClass of, const NanoTree<Value>& tree,
                 const ActiveVoxels& active, uint64_t file_bytes) const {
    const NanoCounts& counts = tree.counts();
    put(out, kNanoGridBytes + tree.bytes());
    put(out, file_bytes);
    put(out, name_hash(name));
    put(out, active.count);
    put(out, nano_type<Value>());
    put(out, static_cast<uint32_t>(of));
    put(out, world_box(grid_.spec, active));
    put(out, active.min);
    put(out, active.max);
    put(out, voxel_sides(grid_.spec));
    put(out, static_cast<uint32_t>(name.size() + 1));
    for (const uint64_t count : {counts.leaves, counts.lowers, counts.uppers, uint64_t{1},
                                 counts.lower_tiles, counts.upper_tiles, uint64_t{0}}) {
      put(out, static_cast<uint32_t>(count));
    }
    put(out, kNanoZip);
    put(out, uint16_t{0});
    put(out, kNanoVersion);
    out.insert(out.end(), name.begin(), name.end());
    out.push_back(0);
  }

  const Grid& grid_;
  const TreeOrder order_;
  const std::vector<std::string> names_;
  OutputFile& file_;
};

}  // namespace
}  // namespace voxeld::vdb

namespace voxeld {

Status encode_nvdb(const Grid& grid, const OutputOptions& /*options*/, OutputFile& file) {
  return vdb::NanoFile(grid, file).write();
}

}  // namespace voxeld
