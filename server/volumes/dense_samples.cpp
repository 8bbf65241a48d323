#include "server/volumes/dense_samples.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <tuple>
#include <type_traits>

#include "server/base/cancel_point.h"
#include "server/grid/color/color_tables.h"
#include "server/volumes/volume_error.h"

namespace voxeld::volumes {
namespace {

// Voxels of a stream that wait to become bricks, so that all cores have work.
constexpr uint64_t kWaitingVoxels = uint64_t{1} << 22;

// Tags of the types that C++ lacks.
struct BoolSample {};
struct HalfSample {};

float float_of_half(uint16_t half) {
  const bool is_negative = half >> 15 != 0;
  const uint32_t exponent = half >> 10 & 0x1f, fraction = half & 0x3ff;
  if (exponent == 0) {
    const float value = std::ldexp(static_cast<float>(fraction), -24);
    return is_negative ? -value : value;
  }
  const uint32_t sign = is_negative ? 0x8000'0000 : 0;
  if (exponent == 0x1f) return std::bit_cast<float>(sign | 0x7f80'0000 | fraction << 13);
  return std::bit_cast<float>(sign | (exponent + 112) << 23 | fraction << 13);
}

template <typename T, bool kIsBigEndian>
T number_at(const uint8_t* at) {
  std::array<uint8_t, sizeof(T)> bytes;
  std::memcpy(bytes.data(), at, sizeof(T));
  if constexpr (kIsBigEndian) std::ranges::reverse(bytes);
  return std::bit_cast<T>(bytes);
}

// A type of samples: its bytes and the value that it reads.
template <typename T, bool kIsBigEndian>
struct Sample {
  using Value = T;
  static constexpr size_t kBytes = sizeof(T);
  static Value at(const uint8_t* bytes) { return number_at<T, kIsBigEndian>(bytes); }
};
template <bool kIsBigEndian>
struct Sample<BoolSample, kIsBigEndian> {
  using Value = uint8_t;
  static constexpr size_t kBytes = 1;
  static Value at(const uint8_t* bytes) { return *bytes != 0 ? 1 : 0; }
};
template <bool kIsBigEndian>
struct Sample<HalfSample, kIsBigEndian> {
  using Value = float;
  static constexpr size_t kBytes = 2;
  static Value at(const uint8_t* bytes) {
    return float_of_half(number_at<uint16_t, kIsBigEndian>(bytes));
  }
};

// Whether a value is at least a threshold. Integers compare with the least integer that is.
template <typename Value>
class AtLeast {
 public:
  explicit AtLeast(double threshold) {
    if constexpr (std::is_integral_v<Value>) {
      const double least = std::ceil(threshold);
      // 2^digits, one more than the largest value.
      const double end = std::ldexp(1.0, std::numeric_limits<Value>::digits);
      has_any_ = least < end;
      least_ = !has_any_ || least <= static_cast<double>(std::numeric_limits<Value>::min())
                   ? std::numeric_limits<Value>::min()
                   : static_cast<Value>(least);
    } else {
      least_ = threshold;
    }
  }
  bool operator()(Value value) const { return has_any_ && value >= least_; }

 private:
  std::conditional_t<std::is_integral_v<Value>, Value, double> least_{};
  bool has_any_ = true;
};

// Whether all bytes are 0, so that no sample among them makes a voxel.
bool are_zero(const uint8_t* bytes, size_t count) {
  uint64_t any = 0;
  size_t at = 0;
  for (; at + sizeof any <= count; at += sizeof any) {
    uint64_t word = 0;
    std::memcpy(&word, bytes + at, sizeof word);
    any |= word;
  }
  for (; at < count; ++at) any |= bytes[at];
  return any == 0;
}

// Bit i of the result is byte i, 0 or 1.
uint64_t bits_of(const std::array<uint8_t, kWordCells>& bytes) {
  // The product moves byte i to bit 56 + i; no two terms meet.
  constexpr uint64_t kGather = 0x0102'0408'1020'4080;
  uint64_t bits = 0;
  for (size_t i = 0; i < kWordCells / 8; ++i) {
    uint64_t eight = 0;
    std::memcpy(&eight, &bytes[8 * i], sizeof eight);
    bits |= eight * kGather >> 56 << 8 * i;
  }
  return bits;
}

// Whether the samples of `count` cells from `first` on lie beside each other and are all 0.
bool are_zero_cells(const uint8_t* first, ptrdiff_t cell_step, size_t count, size_t cell_bytes) {
  const size_t step = static_cast<size_t>(std::abs(cell_step));
  if (step != cell_bytes) return false;
  return are_zero(cell_step < 0 ? first - step * (count - 1) : first, step * count);
}

template <typename T, bool kIsBigEndian>
void scan_numbers(const SampleRow& row, RowCells& cells) {
  using Type = Sample<T, kIsBigEndian>;
  const AtLeast<typename Type::Value> is_voxel(row.threshold);
  const bool skips_zeros = row.threshold > 0;
  cells.words.clear();
  for (size_t begin = 0; begin < row.cells; begin += kWordCells) {
    const size_t count = std::min<size_t>(kWordCells, row.cells - begin);
    const uint8_t* const first = row.first + static_cast<ptrdiff_t>(begin) * row.cell_step;
    if (skips_zeros && are_zero_cells(first, row.cell_step, count, Type::kBytes)) continue;
    std::array<uint8_t, kWordCells> hits{};
    if (row.cell_step == Type::kBytes && count == kWordCells) {  // compilers vectorize it
      for (size_t i = 0; i < kWordCells; ++i) {
        hits[i] = is_voxel(Type::at(first + i * Type::kBytes)) ? 1 : 0;
      }
    } else {
      for (size_t i = 0; i < count; ++i) {
        hits[i] = is_voxel(Type::at(first + static_cast<ptrdiff_t>(i) * row.cell_step)) ? 1 : 0;
      }
    }
    const uint64_t bits = bits_of(hits);
    if (bits != 0) cells.words.emplace_back(static_cast<uint32_t>(begin / kWordCells), bits);
  }
}

// The byte of a component of a colour; `is_color`: in linear light, if it is a float.
uint8_t byte_of(uint8_t sample, bool /*is_color*/) {
  return sample;
}
uint8_t byte_of(float sample, bool is_color) {
  const double value = sample > 0 ? std::min(sample, 1.0F) : 0.0;  // NaN is 0
  if (!is_color) return static_cast<uint8_t>(std::lround(255 * value));
  return srgb8_from_linear16()[static_cast<size_t>(std::lround(65535 * value))];
}

template <typename T, bool kIsBigEndian>
void scan_colors(const SampleRow& row, RowCells& cells) {
  using Type = Sample<T, kIsBigEndian>;
  const size_t cell_bytes = Type::kBytes * row.components;
  cells.words.clear();
  cells.colors.clear();
  const auto sample = [&](const uint8_t* cell, size_t component) {
    return Type::at(cell + static_cast<ptrdiff_t>(component) * row.component_step);
  };
  for (size_t begin = 0; begin < row.cells; begin += kWordCells) {
    const size_t count = std::min<size_t>(kWordCells, row.cells - begin);
    const uint8_t* cell = row.first + static_cast<ptrdiff_t>(begin) * row.cell_step;
    if (are_zero_cells(cell, row.cell_step, count, cell_bytes)) continue;
    uint64_t bits = 0;
    for (size_t i = 0; i < count; ++i, cell += row.cell_step) {
      const bool is_voxel = row.components == 4
                                ? sample(cell, 3) > 0
                                : sample(cell, 0) > 0 || sample(cell, 1) > 0 || sample(cell, 2) > 0;
      if (!is_voxel) continue;
      bits |= uint64_t{1} << i;
      CellColor color{0, 0, 0, 255};
      for (size_t c = 0; c < 3; ++c) color[c] = byte_of(sample(cell, c), true);
      // An alpha that rounds to 0 stays above it: the voxel is one.
      if (row.components == 4) color[3] = std::max<uint8_t>(1, byte_of(sample(cell, 3), false));
      cells.colors.push_back(color);
    }
    if (bits != 0) cells.words.emplace_back(static_cast<uint32_t>(begin / kWordCells), bits);
  }
}

// The types in the order of SampleType.
using SampleTypes = std::tuple<BoolSample, int8_t, uint8_t, int16_t, uint16_t, int32_t, uint32_t,
                               int64_t, uint64_t, HalfSample, float, double>;
constexpr size_t kLastType = std::tuple_size_v<SampleTypes> - 1;
static_assert(static_cast<size_t>(SampleType::kFloat64) == kLastType);

// Calls visit(T()) with the type of samples.
template <size_t kType = 0, typename Visit>
auto with_sample_type(SampleType type, const Visit& visit) {
  using T = std::tuple_element_t<kType, SampleTypes>;
  if constexpr (kType == kLastType) {
    return visit(T());
  } else {
    return type == static_cast<SampleType>(kType) ? visit(T())
                                                  : with_sample_type<kType + 1>(type, visit);
  }
}

// The bytes from a cell to the next one in its row.
size_t cell_bytes_of(const SampleArray& array) {
  return sample_bytes(array.type) * (array.is_planar ? 1 : array.components);
}

// The row whose samples begin at `first`.
SampleRow row_at(const SampleArray& array, const uint8_t* first) {
  const size_t cells = array.order.sides[0];
  const auto step = static_cast<ptrdiff_t>(cell_bytes_of(array));
  const auto component_step =
      static_cast<ptrdiff_t>(sample_bytes(array.type) * (array.is_planar ? array.cell_count() : 1));
  SampleRow row{first, step, component_step, cells, array.components, array.threshold};
  if (array.is_mirrored[0]) {
    row.first += static_cast<ptrdiff_t>(cells - 1) * step;
    row.cell_step = -step;
  }
  return row;
}

// The place of a cell of an axis in the file, or the reverse.
uint32_t mirrored(const SampleArray& array, size_t axis, uint32_t at) {
  return array.is_mirrored[axis] ? array.order.sides[axis] - 1 - at : at;
}

}  // namespace

size_t sample_bytes(SampleType type) {
  return with_sample_type(type, []<typename T>(T) { return Sample<T, false>::kBytes; });
}

uint64_t SampleArray::cell_count() const {
  return uint64_t{order.sides[0]} * order.sides[1] * order.sides[2];
}

uint64_t SampleArray::bytes() const {
  return cell_count() * components * sample_bytes(type);
}

ScanRow row_scanner(const SampleArray& array) {
  if (array.has_color()) {
    if (array.type == SampleType::kUint8) return scan_colors<uint8_t, false>;
    return array.is_big_endian ? scan_colors<float, true> : scan_colors<float, false>;
  }
  return with_sample_type(array.type, [&]<typename T>(T) -> ScanRow {
    return array.is_big_endian ? scan_numbers<T, true> : scan_numbers<T, false>;
  });
}

Result<std::vector<SparseTile>> tiles_of_samples(const SampleArray& array, std::string_view name,
                                                 std::span<const uint8_t> samples) {
  DenseCells cells(array.order, array.has_color());
  const ScanRow scan = row_scanner(array);
  const size_t row_bytes = cell_bytes_of(array) * array.order.sides[0];
  const auto number = [](size_t i) { return i; };
  cells.read(cells.block_count(), number, [&](size_t, const RowBlock& range, CellBlock& block) {
    RowCells found;
    for (uint32_t plane = range.plane_begin; plane < range.plane_end; ++plane) {
      for (uint32_t row = range.row_begin; row < range.row_end; ++row) {
        const size_t before =
            size_t{mirrored(array, 2, plane)} * array.order.sides[1] + mirrored(array, 1, row);
        scan(row_at(array, samples.data() + before * row_bytes), found);
        const CellColor* colors = found.colors.data();
        for (const auto& [word, bits] : found.words) {
          block.add(plane, row, word, bits, colors);
          if (array.has_color()) colors += std::popcount(bits);
        }
      }
    }
  });
  return cells.finish(name);
}

SampleStream::SampleStream(const SampleArray& array, std::string_view name)
    : array_(array),
      name_(name),
      scan_(row_scanner(array)),
      cells_(array.order, array.has_color()),
      row_bytes_(cell_bytes_of(array) * array.order.sides[0]) {}

Status SampleStream::add(std::span<const uint8_t> bytes) {
  if (!partial_row_.empty()) {
    const size_t had = partial_row_.size(), missing = std::min(bytes.size(), row_bytes_ - had);
    partial_row_.resize(had + missing);
    std::copy_n(bytes.data(), missing, partial_row_.data() + had);
    bytes = bytes.subspan(missing);
    if (partial_row_.size() < row_bytes_) return {};
    VOXELD_TRY(add_row(partial_row_.data()));
    partial_row_.clear();
  }
  for (; bytes.size() >= row_bytes_; bytes = bytes.subspan(row_bytes_)) {
    VOXELD_TRY(add_row(bytes.data()));
  }
  partial_row_.assign(bytes.begin(), bytes.end());
  return {};
}

Status SampleStream::add_row(const uint8_t* bytes) {
  const uint32_t plane = mirrored(array_, 2, next_plane_), row = mirrored(array_, 1, next_row_);
  if (++next_row_ == array_.order.sides[1]) {
    next_row_ = 0;
    ++next_plane_;
  }
  const auto slab = plane / static_cast<uint32_t>(limits::kBrickSide);
  if (slab_ != slab) {
    end_slab();
    slab_ = slab;
  }
  scan_(row_at(array_, bytes), row_cells_);
  if (row_cells_.words.empty()) return {};
  const size_t block = cells_.block_of(plane, row);
  const size_t first_block = cells_.block_of(plane, 0);
  if (slab_blocks_.size() <= block - first_block) slab_blocks_.resize(block - first_block + 1);
  Recorded& recorded = slab_blocks_[block - first_block];
  recorded.block = block;
  for (const auto& [word, bits] : row_cells_.words) {
    recorded.words.push_back(
        {plane, row, word, static_cast<uint32_t>(bits), static_cast<uint32_t>(bits >> 32)});
    waiting_voxels_ += static_cast<uint64_t>(std::popcount(bits));
  }
  recorded.colors.insert(recorded.colors.end(), row_cells_.colors.begin(), row_cells_.colors.end());
  return check_volume_voxels(name_, cells_.voxel_count() + waiting_voxels_);
}

void SampleStream::end_slab() {
  for (Recorded& recorded : slab_blocks_) {
    if (!recorded.words.empty()) ended_blocks_.push_back(std::move(recorded));
  }
  slab_blocks_.clear();
  if (waiting_voxels_ >= kWaitingVoxels) store();
}

void SampleStream::store() {
  const auto number = [&](size_t i) { return ended_blocks_[i].block; };
  cells_.read(ended_blocks_.size(), number, [&](size_t i, const RowBlock&, CellBlock& block) {
    const CellColor* colors = ended_blocks_[i].colors.data();
    for (const Word& word : ended_blocks_[i].words) {
      const uint64_t bits = uint64_t{word.bits_high} << 32 | word.bits_low;
      block.add(word.plane, word.row, word.word, bits, colors);
      if (array_.has_color()) colors += std::popcount(bits);
    }
  });
  ended_blocks_.clear();
  waiting_voxels_ = 0;
}

Result<std::vector<SparseTile>> SampleStream::finish() {
  end_slab();
  store();
  return cells_.finish(name_);
}

}  // namespace voxeld::volumes
