// Reads a .nvdb by offsets alone, and checks that all that it says about itself is so: offsets,
// counts, boxes, statistics, checksums. Shares no code with the writer.
#pragma once

#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace voxeld::nvdb_test {

using Bytes = std::vector<uint8_t>;
using Cell = std::array<int32_t, 3>;
using Value = std::array<double, 3>;  // components; further ones are 0

// Offsets of a type's nodes, as PNanoVDB.h lists them.
struct NanoOffsets {
  size_t components;
  size_t root_background, root_statistics, root_bytes;
  size_t entry_bytes;
  size_t upper_bytes, lower_bytes;
  size_t leaf_values, leaf_bytes;
};
inline constexpr NanoOffsets kOfScalars = {1, 28, 32, 64, 8, 270400, 33856, 96, 2144};
inline constexpr NanoOffsets kOfVectors = {3, 28, 40, 96, 16, 532544, 66624, 128, 6272};
inline constexpr size_t kTreeAt = 672, kRootAt = 736, kRootTileBytes = 32;

struct NanoSums {
  uint64_t voxels = 0;
  long double sum = 0, squares = 0;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  Cell first{INT32_MAX, INT32_MAX, INT32_MAX}, last{INT32_MIN, INT32_MIN, INT32_MIN};

  void add(const NanoSums& other) {
    voxels += other.voxels;
    sum += other.sum;
    squares += other.squares;
    low = std::min(low, other.low);
    high = std::max(high, other.high);
    for (size_t c = 0; c < 3; ++c) {
      first[c] = std::min(first[c], other.first[c]);
      last[c] = std::max(last[c], other.last[c]);
    }
  }
};

class NanoGrid {
 public:
  struct Voxel {
    Value value{};
    bool is_active = false;
    int side = 0;  // of its tile in cells; 1: of a leaf
  };

  NanoGrid(Bytes facts, Bytes bytes) : facts_(std::move(facts)), bytes_(std::move(bytes)) {
    type_ = at<uint32_t>(636);
    offsets_ = type_ == 6 ? kOfVectors : kOfScalars;
    check();
  }

  uint32_t type() const { return type_; }
  uint32_t grid_class() const { return at<uint32_t>(632); }
  uint64_t active_count() const { return at<uint64_t>(kTreeAt + 56); }
  uint32_t leaves() const { return at<uint32_t>(kTreeAt + 32); }
  uint32_t tiles(size_t level) const { return at<uint32_t>(kTreeAt + 44 + 4 * level); }
  uint32_t root_tiles() const { return at<uint32_t>(kRootAt + 24); }
  uint64_t bytes() const { return bytes_.size(); }
  Value background() const { return value(kRootAt + offsets_.root_background); }
  template <typename T>
  T at(size_t offset) const {
    if (offset + sizeof(T) > bytes_.size()) throw std::out_of_range("nvdb");
    T value;
    std::memcpy(&value, &bytes_[offset], sizeof value);
    return value;
  }

  Voxel voxel(const Cell& cell) const {
    const auto part = [&](size_t c) { return static_cast<uint64_t>(cell[c]) >> 12; };
    const uint64_t key = part(0) << 42 | part(1) << 21 | part(2);
    for (uint32_t i = 0; i < root_tiles(); ++i) {
      const size_t tile = tile_at(i);
      if (at<uint64_t>(tile) != key) continue;
      const auto child = at<int64_t>(tile + 8);
      if (child != 0) return inner(kRootAt + static_cast<size_t>(child), cell, 5, 128);
      return {value(tile + 20), at<uint32_t>(tile + 16) != 0, 4096};
    }
    return {background(), false, 0};
  }

 private:
  size_t tile_at(uint32_t i) const { return kRootAt + offsets_.root_bytes + i * kRootTileBytes; }
  Value value(size_t offset) const {
    Value value{};
    for (size_t c = 0; c < offsets_.components; ++c) {
      if (type_ == 4) {
        value[c] = at<int32_t>(offset);
      } else {
        value[c] = at<float>(offset + 4 * c);
      }
    }
    return value;
  }
  double measure(const Value& v) const {
    return offsets_.components == 1 ? v[0] : v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
  }
  bool bit(size_t mask, size_t i) const { return (at<uint8_t>(mask + i / 8) >> (i % 8) & 1) != 0; }
  static size_t table_of(size_t log2) { return log2 == 5 ? 8256 : 1088; }
  static size_t mask_bytes(size_t log2) { return (size_t{1} << (3 * log2)) / 8; }

  static size_t entry(const Cell& cell, size_t log2, int side) {
    size_t entry = 0;
    for (const int32_t c : cell) {
      entry = entry << log2 | (static_cast<size_t>(c / side) & ((size_t{1} << log2) - 1));
    }
    return entry;
  }
  Voxel inner(size_t node, const Cell& cell, size_t log2, int side) const {
    const size_t i = entry(cell, log2, side);
    const size_t in_table = node + table_of(log2) + i * offsets_.entry_bytes;
    if (!bit(node + 32 + mask_bytes(log2), i)) {
      return {value(in_table), bit(node + 32, i), side};
    }
    const size_t child = node + at<uint64_t>(in_table);
    if (log2 == 5) return inner(child, cell, 4, 8);
    const size_t v = entry(cell, 3, 1);
    return {value(child + offsets_.leaf_values + v * 4 * offsets_.components), bit(child + 16, v),
            1};
  }

  // Checks the 16 or 32 bytes at `offset`.
  void check_statistics(size_t offset, const NanoSums& sums) const {
    const size_t value_bytes = 4 * offsets_.components;
    const double mean = at<float>(offset + 2 * value_bytes);
    const double deviation = at<float>(offset + 2 * value_bytes + 4);
    if (sums.voxels == 0) {
      EXPECT_EQ(value(offset), background());
      EXPECT_EQ(value(offset + value_bytes), background());
      EXPECT_EQ(mean, 0);
      EXPECT_EQ(deviation, 0);
      return;
    }
    EXPECT_EQ(measure(value(offset)), sums.low);
    EXPECT_EQ(measure(value(offset + value_bytes)), sums.high);
    const long double count = static_cast<long double>(sums.voxels);
    const long double wanted = sums.sum / count;
    const double wanted_deviation =
        static_cast<double>(std::sqrt(std::max(sums.squares / count - wanted * wanted, 0.0L)));
    const double scale = std::max(std::abs(sums.low), std::abs(sums.high));
    EXPECT_NEAR(mean, static_cast<double>(wanted), 1e-7 * scale);
    EXPECT_NEAR(deviation, wanted_deviation, 1e-6 * scale);
  }
  void check_box(size_t offset, const NanoSums& sums) const {
    EXPECT_EQ(at<Cell>(offset), sums.first);
    EXPECT_EQ(at<Cell>(offset + 12), sums.last);
  }

  NanoSums sums_of(const Value& value, const Cell& cell, int side) const {
    NanoSums sums;
    const auto sides = static_cast<uint64_t>(side);
    sums.voxels = sides * sides * sides;
    sums.low = sums.high = measure(value);
    const auto count = static_cast<long double>(sums.voxels);
    sums.sum = count * sums.low;
    sums.squares = count * sums.low * sums.low;
    sums.first = cell;
    for (size_t c = 0; c < 3; ++c) sums.last[c] = cell[c] + side - 1;
    return sums;
  }
  static Cell entry_cell(const Cell& node, size_t i, size_t log2, int side) {
    const size_t low = (size_t{1} << log2) - 1;
    const std::array<size_t, 3> at = {i >> (2 * log2), i >> log2 & low, i & low};
    Cell cell = node;
    for (size_t c = 0; c < 3; ++c) cell[c] += static_cast<int>(at[c]) * side;
    return cell;
  }

  // Nodes follow each other breadth first: `next` of a level is where its next node must be.
  NanoSums check_leaf(size_t leaf, const Cell& cell) {
    EXPECT_EQ(leaf, next_leaf_);
    next_leaf_ += offsets_.leaf_bytes;
    leaf_crcs_.push_back(crc(leaf, offsets_.leaf_bytes));
    NanoSums sums;
    for (size_t i = 0; i < 512; ++i) {
      if (!bit(leaf + 16, i)) continue;
      sums.add(sums_of(value(leaf + offsets_.leaf_values + i * 4 * offsets_.components),
                       entry_cell(cell, i, 3, 1), 1));
    }
    EXPECT_GT(sums.voxels, 0U);
    EXPECT_EQ(at<Cell>(leaf), sums.first);
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(at<uint8_t>(leaf + 12 + c), sums.last[c] - sums.first[c]);
    }
    EXPECT_EQ(at<uint8_t>(leaf + 15), 2);
    check_statistics(leaf + 80, sums);
    return sums;
  }
  NanoSums check_inner(size_t node, const Cell& cell, size_t log2, int side) {
    const bool is_upper = log2 == 5;
    size_t& next = is_upper ? next_upper_ : next_lower_;
    const size_t node_bytes = is_upper ? offsets_.upper_bytes : offsets_.lower_bytes;
    EXPECT_EQ(node, next);
    next += node_bytes;
    (is_upper ? upper_crcs_ : lower_crcs_).push_back(crc(node, node_bytes));
    NanoSums sums;
    const size_t tiles = node + 32, children = tiles + mask_bytes(log2);
    for (size_t i = 0; i < size_t{1} << (3 * log2); ++i) {
      const size_t in_table = node + table_of(log2) + i * offsets_.entry_bytes;
      const Cell at_cell = entry_cell(cell, i, log2, side);
      if (bit(tiles, i)) {
        EXPECT_FALSE(bit(children, i));
        sums.add(sums_of(value(in_table), at_cell, side));
        ++tiles_[is_upper ? 1 : 0];
      } else if (bit(children, i)) {
        const size_t child = node + at<uint64_t>(in_table);
        sums.add(is_upper ? check_inner(child, at_cell, 4, 8) : check_leaf(child, at_cell));
      }
    }
    EXPECT_GT(sums.voxels, 0U);
    check_box(node, sums);
    EXPECT_EQ(at<uint64_t>(node + 24), 2U);
    check_statistics(node + 32 + 2 * mask_bytes(log2), sums);
    return sums;
  }

  uint32_t crc(size_t offset, size_t bytes) const {
    if (offset + bytes > bytes_.size()) throw std::out_of_range("nvdb");
    return static_cast<uint32_t>(crc32_z(0, &bytes_[offset], bytes));
  }

  void check() {
    const std::array<uint32_t, 3> nodes = {leaves(), at<uint32_t>(kTreeAt + 36),
                                           at<uint32_t>(kTreeAt + 40)};
    EXPECT_EQ(at<uint64_t>(kTreeAt + 24), kRootAt - kTreeAt);
    const size_t head_end = tile_at(root_tiles());
    next_upper_ = head_end;
    next_lower_ = next_upper_ + nodes[2] * offsets_.upper_bytes;
    next_leaf_ = next_lower_ + nodes[1] * offsets_.lower_bytes;
    const std::array<size_t, 3> firsts = {next_leaf_, next_lower_, next_upper_};
    for (size_t level = 0; level < 3; ++level) {
      EXPECT_EQ(at<uint64_t>(kTreeAt + 8 * level), nodes[level] == 0 ? 0 : firsts[level] - kTreeAt);
    }
    EXPECT_EQ(bytes_.size(), next_leaf_ + nodes[0] * offsets_.leaf_bytes);
    NanoSums sums;
    uint64_t before = 0;
    for (uint32_t i = 0; i < root_tiles(); ++i) {
      const auto key = at<uint64_t>(tile_at(i));
      EXPECT_TRUE(i == 0 || before < key);
      before = key;
      const uint64_t low = (1U << 21) - 1;
      const Cell cell = {static_cast<int32_t>(key >> 42 & low) * 4096,
                         static_cast<int32_t>(key >> 21 & low) * 4096,
                         static_cast<int32_t>(key & low) * 4096};
      const auto child = at<int64_t>(tile_at(i) + 8);
      EXPECT_EQ(at<uint32_t>(tile_at(i) + 16), 0U);
      if (child != 0) {
        sums.add(check_inner(kRootAt + static_cast<size_t>(child), cell, 5, 128));
      }
    }
    EXPECT_EQ(next_upper_, firsts[1]);
    EXPECT_EQ(next_lower_, firsts[0]);
    EXPECT_EQ(next_leaf_, bytes_.size());
    check_box(kRootAt, sums);
    check_statistics(kRootAt + offsets_.root_statistics, sums);
    EXPECT_EQ(active_count(), sums.voxels);
    EXPECT_EQ(tiles(0), tiles_[0]);
    EXPECT_EQ(tiles(1), tiles_[1]);
    EXPECT_EQ(tiles(2), 0U);
    check_head(head_end, sums);
    check_facts();
  }

  void check_head(size_t head_end, const NanoSums& sums) const {
    EXPECT_EQ(std::string(bytes_.begin(), bytes_.begin() + 8), "NanoVDB0");
    EXPECT_EQ(at<uint32_t>(8), crc(16, head_end - 16));
    std::vector<uint64_t> crcs = upper_crcs_;
    crcs.insert(crcs.end(), lower_crcs_.begin(), lower_crcs_.end());
    crcs.insert(crcs.end(), leaf_crcs_.begin(), leaf_crcs_.end());
    const uLong all = crc32_z(0, reinterpret_cast<const Bytef*>(crcs.data()), 8 * crcs.size());
    EXPECT_EQ(at<uint32_t>(12), crcs.empty() ? UINT32_MAX : static_cast<uint32_t>(all));
    EXPECT_EQ(at<uint32_t>(16), (32U << 21) + (4U << 10) + 2);
    EXPECT_EQ(at<uint32_t>(20), sums.voxels == 0 ? 60U : 62U);
    EXPECT_EQ(at<uint32_t>(24), 0U);
    EXPECT_EQ(at<uint32_t>(28), 1U);
    EXPECT_EQ(at<uint64_t>(32), bytes_.size());
    for (size_t i = 640; i < kTreeAt; ++i) EXPECT_EQ(bytes_[i], 0);
  }

  // The facts of the segment are those of the grid.
  void check_facts() const {
    const auto same = [&](size_t of_facts, size_t of_grid, size_t bytes) {
      EXPECT_EQ(std::memcmp(&facts_[of_facts], &bytes_[of_grid], bytes), 0) << of_facts;
    };
    same(0, 32, 8);               // bytes
    same(24, kTreeAt + 56, 8);    // active voxels
    same(32, 636, 4);             // type
    same(36, 632, 4);             // class
    same(40, 560, 48);            // world box
    same(88, kRootAt, 24);        // box
    same(112, 608, 24);           // voxel size
    same(140, kTreeAt + 32, 12);  // nodes
    same(156, kTreeAt + 44, 12);  // tiles
    same(172, 16, 4);             // version
    EXPECT_EQ(facts_[152], 1);
    EXPECT_EQ(facts_[168], 1);  // codec
  }

  Bytes facts_, bytes_;
  uint32_t type_ = 0;
  NanoOffsets offsets_ = kOfScalars;
  size_t next_upper_ = 0, next_lower_ = 0, next_leaf_ = 0;
  std::array<uint32_t, 2> tiles_{};
  std::vector<uint64_t> upper_crcs_, lower_crcs_, leaf_crcs_;
};

// The grids of a file, by name.
inline std::map<std::string, NanoGrid> read_nvdb(const Bytes& file) {
  size_t at = 0;
  const auto take = [&](size_t count) {
    if (at + count > file.size()) throw std::out_of_range("nvdb");
    at += count;
    return Bytes(file.begin() + static_cast<ptrdiff_t>(at - count),
                 file.begin() + static_cast<ptrdiff_t>(at));
  };
  const auto number = [](const Bytes& bytes, size_t offset, size_t count) {
    uint64_t value = 0;
    std::memcpy(&value, &bytes[offset], count);
    return value;
  };
  const Bytes head = take(16);
  EXPECT_EQ(std::string(head.begin(), head.begin() + 8), "NanoVDB0");
  EXPECT_EQ(number(head, 8, 4), (32U << 21) + (4U << 10) + 2);
  EXPECT_EQ(number(head, 14, 2), 1U);
  std::vector<std::pair<std::string, Bytes>> facts;
  for (uint64_t i = number(head, 12, 2); i > 0; --i) {
    Bytes of_grid = take(176);
    const Bytes name = take(number(of_grid, 136, 4));
    EXPECT_EQ(name.back(), 0);
    facts.emplace_back(reinterpret_cast<const char*>(name.data()), of_grid);
  }
  std::map<std::string, NanoGrid> grids;
  for (auto& [name, of_grid] : facts) {
    const Bytes stored = take(number(of_grid, 8, 8));
    EXPECT_EQ(number(stored, 0, 8), stored.size() - 8);
    Bytes bytes(number(of_grid, 0, 8) + 1);
    uLongf length = bytes.size();
    EXPECT_EQ(uncompress(bytes.data(), &length, &stored[8], stored.size() - 8), Z_OK);
    bytes.resize(length);
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(&bytes.at(40))), name);
    grids.emplace(name, NanoGrid(of_grid, bytes));
  }
  EXPECT_EQ(at, file.size());
  return grids;
}

}  // namespace voxeld::nvdb_test
