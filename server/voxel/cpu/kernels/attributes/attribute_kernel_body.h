// The kernel of one instruction set. Included once by each attribute_kernel_….cpp.
#pragma once

#include "server/base/simd/lanes.h"
#include "server/voxel/cpu/kernels/attributes/attribute_kernel.h"
#include "server/voxel/cpu/kernels/attributes/attribute_pairs.h"

namespace voxeld {
namespace {

constexpr int kAreaSide = 4096;      // AREA_SIDE
constexpr int kStripRows = 2;        // AREA_STRIP_ROWS
constexpr int kWeightOne = 1 << 24;  // 1 << ATTRIBUTE_WEIGHT_BITS

// ColumnRows without the intervals.
struct Rows {
  Rows(const PairTriangle& t, const Cells& at)
      : low(clamped(t.low - at.j * kAreaSide, 0, kAreaSide)),
        spacing(
            greater(lesser(t.high - at.j * kAreaSide, all_lanes(kAreaSide)) - low, IntLanes{}) >>
            4) {}
  IntLanes low, spacing;
};

// The crossings of a line with consecutive rows.
class Crossings {
 public:
  Crossings(const PairLine& line, IntLanes constants, const Rows& rows)
      : line_(line),
        rest_(-(line.b * (rows.low + rows.spacing) + constants)),
        step_(2 * line.b * rows.spacing) {}

  // row_crossing() of the next row.
  IntLanes next() {
    const IntLanes within = clamped(rest_, 0, line_.span);
    rest_ -= step_;
    return as_signed(((as_unsigned(within) >> line_.shift) * line_.reciprocal) >> 19);
  }

 private:
  const PairLine& line_;
  IntLanes rest_, step_;
};

struct RowSums {
  UintLanes length{}, x{}, y{}, squares{};
};

// side_constant() of attributes.glsl.
IntLanes side_constant(const PairSide& side, const Cells& at) {
  constexpr int64_t kLimit = 1 << 29;
  constexpr int64_t kBias = int64_t{1} << 60;  // makes every value positive; a multiple of 2^shift
  HalfInts out[2];
  for (int h = 0; h < 2; ++h) {
    LongLanes v = product(long_half(at.i, h), side.a) + product(long_half(at.j, h), side.b);
    v = (v << 12) + side.rest * 8 + kBias;
    v = reinterpret_cast<LongLanes>(reinterpret_cast<UlongLanes>(v) >> side.shift) -
        (kBias >> side.shift);
    v = v < -kLimit ? LongLanes{} - kLimit : v;
    v = v > kLimit ? LongLanes{} + kLimit : v;
    out[h] = __builtin_convertvector(v, HalfInts);
  }
  return joined(out);
}

// level_constant() of the level at which the rows in cells (i, j, k) begin.
IntLanes left_constant(const PairTriangle& t, const Cells& at) {
  constexpr int64_t kBias = int64_t{1} << 60;
  const IntLanes first = t.slope_i < 0 ? at.k + 1 : at.k;
  HalfInts out[2];
  for (int h = 0; h < 2; ++h) {
    LongLanes v = product(long_half(at.i, h), t.slope_i) + product(long_half(at.j, h), t.slope_j) +
                  t.depth - (long_half(first, h) << 24);
    v = reinterpret_cast<LongLanes>(reinterpret_cast<UlongLanes>(v + kBias) >> 9) - (kBias >> 9);
    out[h] = __builtin_convertvector(v, HalfInts);
  }
  const IntLanes rise = joined(out);
  return (t.slope_i < 0 ? -rise : rise) * kAreaSide;
}

// cell_area() of kLanes pairs, strip after strip.
class CellRows {
 public:
  CellRows(const PairTriangle& t, const Cells& cells, const Rows& rows)
      : CellRows(t, cells, rows, left_constant(t, cells)) {}

  RowSums next_strip() {
    RowSums sums;
    if (t_.factor == 0) return sums;
    for (int n = 0; n < kStripRows; ++n, ++row_) {
      IntLanes first = left_.next(), last = right_.next();
      for (int s = 0; s < 3; ++s) {
        const IntLanes x = sides_[s].next();
        if (t_.sides[s].is_right) {
          first = greater(first, x);
        } else {
          last = lesser(last, x);
        }
      }
      const UintLanes l = as_unsigned(greater(last - first, IntLanes{}));
      sums.length += l;
      sums.x += l * as_unsigned(first + last);
      sums.y += l * static_cast<uint32_t>(2 * row_ + 1);
      sums.squares += l * l;
    }
    return sums;
  }

 private:
  // left: left_constant() of the cells.
  CellRows(const PairTriangle& t, const Cells& cells, const Rows& rows, IntLanes left)
      : t_(t),
        sides_{{t.sides[0].line, side_constant(t.sides[0], cells), rows},
               {t.sides[1].line, side_constant(t.sides[1], cells), rows},
               {t.sides[2].line, side_constant(t.sides[2], cells), rows}},
        left_(t.level, left, rows),
        right_(t.level, left - (kAreaSide << 15), rows) {}

  const PairTriangle& t_;
  Crossings sides_[3];
  Crossings left_, right_;
  int row_ = 0;
};

// The quotient of integers from 0 to 2^30. Doubles give it exactly, because a quotient that is not
// an integer differs from the next one by at least 2^-30 of itself.
IntLanes quotient(UintLanes a, UintLanes b) {
  HalfInts out[2];
  for (int h = 0; h < 2; ++h)
    out[h] = truncated(double_half(as_signed(a), h) / double_half(as_signed(b), h));
  return joined(out);
}

struct Position {
  IntLanes x, y;  // 1/512 of a cell
};

Position sample_position(const PairTriangle& t, const Cells& cells, const Rows& rows,
                         const RowSums& sums) {
  const IntLanes i = cells.i * 512, j = cells.j * 512;
  const IntLanes none = as_signed(sums.length) == 0;
  const UintLanes length = as_unsigned(none ? all_lanes(1) : as_signed(sums.length));
  const IntLanes x = quotient(sums.x, length * 2u);
  const IntLanes y = rows.low + quotient(sums.y * as_unsigned(rows.spacing), length);
  const IntLanes middle_x = clamped(i + 256, t.box_min[0], t.box_max[0]);
  const IntLanes middle_y = clamped(j + 256, t.box_min[1], t.box_max[1]);
  return {none ? middle_x : i + 1 + ((x + 4) >> 3), none ? middle_y : j + 1 + ((y + 4) >> 3)};
}

UintLanes rows_area(const Rows& rows, const RowSums& sums) {
  return (sums.length * as_unsigned(rows.spacing)) >> 8;
}

// form_weight() of attributes.glsl.
IntLanes form_weight(const PairTriangle& t, const PairForm& form, const Position& at) {
  HalfInts out[2];
  for (int h = 0; h < 2; ++h) {
    LongLanes value =
        product(long_half(at.x, h), form.x) + product(long_half(at.y, h), form.y) + form.rest;
    value = value < 0 ? LongLanes{} : value;
    const LongLanes limit = LongLanes{} + t.limit;
    value = value > limit ? limit : value;
    const auto weight = reinterpret_cast<UlongLanes>(value * t.reciprocal) >> 34;
    out[h] = __builtin_convertvector(reinterpret_cast<LongLanes>(weight), HalfInts);
  }
  return joined(out);
}

struct Weights {
  IntLanes w1{}, w2{};
};

Weights corner_weights(const PairTriangle& t, const Position& at) {
  const IntLanes w1 = form_weight(t, t.form1, at);
  return {w1, lesser(form_weight(t, t.form2, at), kWeightOne - w1)};
}

UintLanes pair_weight(const PairTriangle& t, UintLanes area) {
  if (t.weight != 0) return UintLanes{} + t.weight;
  const UintLanes weight = (area * t.factor + (1u << 10)) >> 11;
  return as_unsigned(greater(as_signed(weight), all_lanes(1)));
}

// Values of a group of pairs, weighted, as they are added to the sums.
struct Products {
  alignas(64) uint32_t of[8][kLanes];
};

void multiply(const PairTriangle& t, const PairBatch& pairs, int at, Products& out) {
  const Cells cells(pairs, at);
  const Rows rows(t, cells);
  RowSums all;
  if (t.weight == 0 || !t.is_flat) {
    CellRows cell(t, cells, rows);
    for (int n = 0; n < kPairStrips; ++n) {
      const RowSums strip = cell.next_strip();
      all.length += strip.length;
      all.x += strip.x;
      all.y += strip.y;
    }
  }
  const UintLanes weight = pair_weight(t, rows_area(rows, all));
  store(weight, out.of[0]);
  if (t.is_flat) {
    for (int v = 0; v < t.value_count; ++v) store(weight * t.values[v][0], out.of[1 + v]);
    return;
  }
  if (t.value_count == 0) return;
  const Weights w = corner_weights(t, sample_position(t, cells, rows, all));
  const UintLanes w1 = as_unsigned(w.w1) >> 9, w2 = as_unsigned(w.w2) >> 9;
  const UintLanes w0 = 32768u - w1 - w2;
  for (int v = 0; v < t.value_count; ++v) {
    const uint32_t* value = t.values[v];
    store(weight * ((w0 * value[0] + w1 * value[1] + w2 * value[2]) >> 15), out.of[1 + v]);
  }
}

template <int kChannels>
void add_products(const Products& products, const uint32_t* voxels, int count, uint64_t* sums) {
  for (int lane = 0; lane < count; ++lane) {
    uint64_t* sum = sums + size_t{voxels[lane]} * kChannels;
    for (int c = 0; c < kChannels; ++c) sum[c] += products.of[c][lane];
  }
}

void add_products(int channels, const Products& products, const uint32_t* voxels, int count,
                  uint64_t* sums) {
  switch (channels) {
    case 1:
      return add_products<1>(products, voxels, count, sums);
    case 4:
      return add_products<4>(products, voxels, count, sums);
    case 5:
      return add_products<5>(products, voxels, count, sums);
    case 7:
      return add_products<7>(products, voxels, count, sums);
    default:
      return add_products<8>(products, voxels, count, sums);
  }
}

void add_batch(const PairTriangle& triangle, const PairBatch& pairs, uint64_t* sums) {
  Products products;
  for (int at = 0; at < pairs.count; at += kLanes) {
    multiply(triangle, pairs, at, products);
    add_products(1 + triangle.value_count, products, pairs.voxel + at,
                 lesser(pairs.count - at, kLanes), sums);
  }
}

void measure_batch(const PairTriangle& triangle, const PairBatch& pairs, PairAreas& out) {
  for (int at = 0; at < pairs.count; at += kLanes) {
    const Cells cells(pairs, at);
    const Rows rows(triangle, cells);
    RowSums all;
    CellRows cell(triangle, cells, rows);
    for (PairAreas::Strip& strip : out.strips) {
      const RowSums sums = cell.next_strip();
      store(sums.length, strip.length + at);
      store(sums.x, strip.x + at);
      store(sums.y, strip.y + at);
      store(sums.squares, strip.squares + at);
      all.length += sums.length;
      all.x += sums.x;
      all.y += sums.y;
    }
    const Weights weights = corner_weights(triangle, sample_position(triangle, cells, rows, all));
    const UintLanes area = rows_area(rows, all);
    store(rows.low, out.low + at);
    store(rows.spacing, out.spacing + at);
    store(all.length, out.length + at);
    store(area, out.area + at);
    store(pair_weight(triangle, area), out.weight + at);
    store(weights.w1, out.w1 + at);
    store(weights.w2, out.w2 + at);
  }
}

void add(const PairTriangle& triangle, const PairTouch& touch, const PairVoxels& voxels,
         PairBatch& pairs, uint64_t* sums) {
  for_each_batch(touch, voxels, pairs, [&] { add_batch(triangle, pairs, sums); });
}

void measure(const PairTriangle& triangle, const PairTouch& touch, const PairVoxels& voxels,
             PairBatch& pairs, PairAreas& areas, void (*take)(void* context), void* context) {
  for_each_batch(touch, voxels, pairs, [&] {
    measure_batch(triangle, pairs, areas);
    take(context);
  });
}

}  // namespace
}  // namespace voxeld
