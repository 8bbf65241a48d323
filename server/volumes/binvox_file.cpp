// Reads Patrick Min's .binvox, version 1, the reverse of server/formats/volume/binvox.cpp:
//
//   #binvox 1
//   dim D H W          cells in x, z, y; most programs write and read cubes alone
//   translate X Y Z    the min corner of the grid in world units; 0 if it is missing
//   scale S            the longest side of the grid in world units; without it, voxels have side 1
//   data
//   u8 value 0 or 1, u8 count 1..255, over cells with y fastest, then z, then x
//
// Lines end with LF or CRLF. Those between the first and the last one come in any order. Cells are
// made from runs on all cores, which find theirs by sums of the counts before them. The
// specification: https://www.patrickmin.com/binvox/binvox.html
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/limits.h"
#include "proto/text/number_text.h"
#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/volumes/dense_cells.h"
#include "server/volumes/header_text.h"
#include "server/volumes/volume_error.h"
#include "server/volumes/volume_files.h"

namespace voxeld::volumes {
namespace {

constexpr size_t kRunBytes = 2;
constexpr uint64_t kRunMax = 255;
constexpr double kScaleMin = 1e-25;  // world units: voxels of at least 6e-30

struct BinvoxHeader {
  std::optional<std::array<uint32_t, 3>> dim;  // x, z, y
  std::optional<glm::dvec3> translate;
  std::optional<double> scale;
};

Status read_binvox_dim(std::string_view name, std::string_view text, BinvoxHeader& header) {
  const auto words = words_of_line(text);
  std::array<int64_t, 3> dim{};
  for (size_t i = 0; i < 3; ++i) {
    const auto number = words.size() == 3 ? parse_digits<int64_t>(words[i]) : std::nullopt;
    if (!number || *number < 1) {
      return malformed_volume(name, "dim", "sides of the grid", "3 numbers from 1 on",
                              shown_text(text));
    }
    dim[i] = *number;
  }
  VOXELD_TRY(check_volume_dims(name, {dim[0], dim[2], dim[1]}));
  header.dim.emplace();
  std::ranges::transform(dim, header.dim->begin(),
                         [](int64_t side) { return static_cast<uint32_t>(side); });
  return {};
}

Status read_binvox_line(std::string_view name, std::string_view line, BinvoxHeader& header) {
  const std::string_view word = line.substr(0, line.find(' '));
  const std::string_view text = line.substr(word.size());
  const bool is_again = (word == "dim" && header.dim) ||
                        (word == "translate" && header.translate) ||
                        (word == "scale" && header.scale);
  if (is_again) return malformed_volume(name, word, "the line is there twice");
  if (word == "dim") return read_binvox_dim(name, text, header);
  if (word == "translate") {
    const auto numbers = coordinates<3>(words_of_line(text));
    if (!numbers) {
      return malformed_volume(name, word, "corner of the grid", "3 numbers of at most 1e30",
                              shown_text(text));
    }
    header.translate = glm::dvec3((*numbers)[0], (*numbers)[1], (*numbers)[2]);
    return {};
  }
  if (word == "scale") {
    const auto numbers = coordinates<1>(words_of_line(text));
    if (!numbers || (*numbers)[0] < kScaleMin) {
      return malformed_volume(name, word, "side of the grid", "a number from 1e-25 to 1e30",
                              shown_text(text));
    }
    header.scale = (*numbers)[0];
    return {};
  }
  return malformed_volume(name, "header", "unknown line", "dim, translate, scale or data",
                          shown_text(line));
}

// Reads the header and moves `lines` to the runs.
Result<BinvoxHeader> read_binvox_header(std::string_view name, HeaderLines& lines) {
  const auto first = lines.next();
  if (!first || *first != "#binvox 1") {
    return malformed_volume(name, "line 1", "not version 1 of binvox", "\"#binvox 1\"",
                            shown_text(first.value_or("")));
  }
  BinvoxHeader header;
  while (true) {
    const auto line = lines.next();
    if (!line) return malformed_volume(name, "header", "the file ends", "a line \"data\"");
    if (*line == "data") break;
    VOXELD_TRY(read_binvox_line(name, *line, header));
  }
  if (!header.dim) return malformed_volume(name, "header", "sides are missing", "a line \"dim\"");
  return header;
}

// The runs of a file, with the cells before each 2048th one.
class BinvoxRuns {
 public:
  BinvoxRuns(std::span<const uint8_t> bytes, size_t begin_byte)
      : bytes_(bytes), begin_byte_(begin_byte), count_(bytes.size() / kRunBytes) {}

  // Checks the runs against the number of cells.
  Status check(std::string_view name, uint64_t cells) {
    if (bytes_.size() % kRunBytes != 0) {
      return malformed_volume(name, place(count_), "half a run", "a value and a count",
                              "the end of the file");
    }
    if (cells > count_ * kRunMax) {
      return malformed_volume(name, "data", "too few runs for the cells",
                              "at least " + std::to_string((cells + kRunMax - 1) / kRunMax),
                              std::to_string(count_));
    }
    std::vector<uint64_t> sums((count_ + kChunkRuns - 1) / kChunkRuns);
    std::vector<size_t> broken(sums.size(), count_);
    ThreadPool::shared().for_each(sums.size(), [&](size_t chunk) {
      if (chunk % 64 == 0) cancel_point();  // on the calling thread
      const size_t end = std::min(count_, (chunk + 1) * kChunkRuns);
      for (size_t run = chunk * kChunkRuns; run < end; ++run) {
        sums[chunk] += length(run);
        if (bytes_[kRunBytes * run] > 1 || length(run) == 0)
          broken[chunk] = std::min(broken[chunk], run);
      }
    });
    for (const size_t run : broken) {
      if (run == count_) continue;
      return malformed_volume(name, place(run), "a run", "value 0 or 1 and a count from 1 on",
                              "value " + std::to_string(bytes_[kRunBytes * run]) + ", count " +
                                  std::to_string(length(run)));
    }
    before_.assign(1, 0);
    for (const uint64_t sum : sums) before_.push_back(before_.back() + sum);
    if (before_.back() == cells) return {};
    return malformed_volume(name, "data", "the runs are not those of the cells",
                            std::to_string(cells) + " cells", std::to_string(before_.back()));
  }

  // Calls visit(begin, end) for the occupied cells of [begin, end), in parts of a run each.
  template <typename Visit>
  void occupied(uint64_t begin, uint64_t end, const Visit& visit) const {
    const auto after = std::ranges::upper_bound(before_, begin);
    const auto chunk = static_cast<size_t>(after - before_.begin()) - 1;
    uint64_t at = before_[chunk];
    for (size_t run = chunk * kChunkRuns; at < end; ++run) {
      const uint64_t stop = at + length(run);
      if (bytes_[kRunBytes * run] != 0 && stop > begin) {
        visit(std::max(at, begin), std::min(stop, end));
      }
      at = stop;
    }
  }

 private:
  static constexpr size_t kChunkRuns = 2048;

  uint64_t length(size_t run) const { return bytes_[kRunBytes * run + 1]; }
  std::string place(size_t run) const {
    return "byte " + std::to_string(begin_byte_ + kRunBytes * run);
  }

  std::span<const uint8_t> bytes_;
  size_t begin_byte_;
  size_t count_;
  std::vector<uint64_t> before_;
};

// Adds the occupied cells of a block's rows in one plane.
void add_binvox_plane(const BinvoxRuns& runs, const CellOrder& order, const RowBlock& range,
                      uint32_t plane, CellBlock& block) {
  const uint64_t side = order.sides[0];
  const uint64_t before = uint64_t{plane} * order.sides[1];  // rows
  uint32_t row = range.row_begin;
  uint64_t row_begin = (before + row) * side;
  runs.occupied(row_begin, (before + range.row_end) * side, [&](uint64_t begin, uint64_t end) {
    if (begin >= row_begin + side) {
      row = static_cast<uint32_t>(begin / side - before);
      row_begin = (before + row) * side;
    }
    while (begin < end) {
      const uint64_t stop = std::min(end, row_begin + side);
      block.add_run(plane, row, static_cast<uint32_t>(begin - row_begin),
                    static_cast<uint32_t>(stop - row_begin));
      begin = stop;
      if (begin < end) {
        ++row;
        row_begin += side;
      }
    }
  });
}

}  // namespace

Result<Volume> read_binvox(std::string_view name, std::span<const uint8_t> bytes) {
  HeaderLines lines(bytes);
  VOXELD_ASSIGN(const BinvoxHeader header, read_binvox_header(name, lines));
  const auto [x, z, y] = *header.dim;
  const CellOrder order{{y, z, x}, {1, 2, 0}};
  BinvoxRuns runs(bytes.subspan(lines.at()), lines.at());
  VOXELD_TRY(runs.check(name, uint64_t{x} * y * z));

  Volume volume;
  GridSpec& spec = volume.grid.spec;
  spec.dims = {static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)};
  spec.origin_world = header.translate.value_or(glm::dvec3(0));
  if (header.scale) spec.voxel_size = glm::dvec3(*header.scale / std::max({x, y, z}));
  DenseCells cells(order, false);
  const auto number = [](size_t i) { return i; };
  cells.read(cells.block_count(), number, [&](size_t, const RowBlock& range, CellBlock& block) {
    for (uint32_t plane = range.plane_begin; plane < range.plane_end; ++plane) {
      add_binvox_plane(runs, order, range, plane, block);
    }
  });
  VOXELD_ASSIGN(volume.grid.tiles, cells.finish(name));
  return volume;
}

}  // namespace voxeld::volumes
