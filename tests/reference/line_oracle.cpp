#include "tests/reference/line_oracle.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <optional>
#include <utility>

namespace voxeld::reference {
namespace {

using Wide = __int128;

Wide gcd(Wide a, Wide b) {
  a = a < 0 ? -a : a;
  b = b < 0 ? -b : b;
  while (b > UINT64_MAX) {
    const Wide rest = a % b;
    a = b;
    b = rest;
  }
  if (b == 0) return a;
  // Most of the work, and 64 bits are much faster.
  return Wide{std::gcd(static_cast<uint64_t>(a % b), static_cast<uint64_t>(b))};
}

// numerator / denominator in lowest terms, denominator > 0. For coordinates up to 2^21 everything
// here stays below 2^112.
struct Rational {
  Wide n = 0, d = 1;

  Rational(Wide value) : n(value) {}  // NOLINT(google-explicit-constructor)
  Rational(Wide numerator, Wide denominator) {
    const Wide common = gcd(numerator, denominator) * (denominator < 0 ? -1 : 1);
    n = numerator / common;
    d = denominator / common;
  }
  friend Rational operator+(const Rational& a, const Rational& b) {
    return {a.n * b.d + b.n * a.d, a.d * b.d};
  }
  friend Rational operator-(const Rational& a, const Rational& b) {
    return {a.n * b.d - b.n * a.d, a.d * b.d};
  }
  friend Rational operator*(const Rational& a, const Rational& b) { return {a.n * b.n, a.d * b.d}; }
  friend Rational operator/(const Rational& a, const Rational& b) { return {a.n * b.d, a.d * b.n}; }
  friend bool operator==(const Rational& a, const Rational& b) { return a.n == b.n && a.d == b.d; }
  friend bool operator<(const Rational& a, const Rational& b) { return (a - b).n < 0; }
};

Wide floor_of(const Rational& value) {
  const Wide quotient = value.n / value.d;
  return value.n % value.d < 0 ? quotient - 1 : quotient;
}

// The crossing of a side of the triangle with the plane x = X, and the slope of y over x there.
struct Crossing {
  Rational y, z, slope;
};

// Corners are never at X, so there are two crossings or none.
std::vector<Crossing> crossings(const Snapped& t, int x, int y, int z, int64_t at_x) {
  std::vector<Crossing> found;
  for (size_t i = 0; i < 3; ++i) {
    const auto &p = t[i], &e = t[(i + 1) % 3];
    if ((p[static_cast<size_t>(x)] < at_x) == (e[static_cast<size_t>(x)] < at_x)) continue;
    const auto difference = [&](int axis) {
      return Rational(e[static_cast<size_t>(axis)] - p[static_cast<size_t>(axis)]);
    };
    const Rational share = Rational(at_x - p[static_cast<size_t>(x)]) / difference(x);
    found.push_back({Rational(p[static_cast<size_t>(y)]) + share * difference(y),
                     Rational(p[static_cast<size_t>(z)]) + share * difference(z),
                     difference(y) / difference(x)});
  }
  return found;
}

struct Range {
  Rational first, last;
};

// The common range of the triangle and the line (X, Y) along z.
std::optional<Range> common(const Snapped& t, int x, int y, int z, int64_t at_x, int64_t at_y) {
  std::vector<Crossing> ends = crossings(t, x, y, z, at_x);
  if (ends.empty()) return std::nullopt;
  Crossing a = ends[0], b = ends[1];
  if (b.y < a.y) std::swap(a, b);
  const Rational wanted(at_y);
  if (wanted < a.y || b.y < wanted) return std::nullopt;
  if (a.y == b.y) return Range{std::min(a.z, b.z), std::max(a.z, b.z)};
  // In this order, because the quotient has far smaller terms than what it is made of.
  const Rational depth = a.z + (b.z - a.z) / (b.y - a.y) * (wanted - a.y);
  return Range{depth, depth};
}

// a + slope e + more e^2 against b: by the first of them that differs.
bool is_below(const Rational& a, const Rational& a_slope, const Rational& b,
              const Rational& b_slope) {
  return a == b ? a_slope < b_slope : a < b;
}

// Whether (X + e, Y + e^2) is inside the triangle's projection along z.
bool has_centre(const Snapped& t, int x, int y, int z, int64_t at_x, int64_t at_y) {
  std::vector<Crossing> ends = crossings(t, x, y, z, at_x);
  if (ends.empty()) return false;
  if (is_below(ends[1].y, ends[1].slope, ends[0].y, ends[0].slope)) std::swap(ends[0], ends[1]);
  const Rational wanted(at_y), level(0);
  // Y + e^2 lies above a side that runs level through Y, which has no e^2.
  const bool above_low = !is_below(wanted, level, ends[0].y, ends[0].slope);
  return above_low && is_below(wanted, level, ends[1].y, ends[1].slope);
}

int64_t centre_of(int cell) {
  return int64_t{512} * cell + 256;
}

int axis_of_largest_normal(const Snapped& t) {
  std::array<Wide, 3> normal{};
  for (size_t c = 0; c < 3; ++c) {
    const size_t u = (c + 1) % 3, v = (c + 2) % 3;
    normal[c] = Wide{t[1][u] - t[0][u]} * (t[2][v] - t[0][v]) -
                Wide{t[1][v] - t[0][v]} * (t[2][u] - t[0][u]);
    if (normal[c] < 0) normal[c] = -normal[c];
  }
  int best = 2;
  for (const int axis : {0, 1}) {
    if (normal[static_cast<size_t>(axis)] > normal[static_cast<size_t>(best)]) best = axis;
  }
  return normal[static_cast<size_t>(best)] == 0 ? -1 : best;
}

// Cells along z of the line through the centre of a cell, whose own z does not matter.
struct Cells {
  int64_t first = 0, last = -1;
};

Cells thin_line(const Snapped& t, int axis, const std::array<int, 3>& cell) {
  const int x = (axis + 1) % 3, y = (axis + 2) % 3;
  const auto range = common(t, x, y, axis, centre_of(cell[static_cast<size_t>(x)]),
                            centre_of(cell[static_cast<size_t>(y)]));
  if (!range) return {};
  const Rational side(512);
  return {static_cast<int64_t>(floor_of(range->first / side)),
          static_cast<int64_t>(floor_of(range->last / side))};
}

// Only along the dominant axis.
Cells center_line(const Snapped& t, int axis, const std::array<int, 3>& cell) {
  if (axis != axis_of_largest_normal(t)) return {};
  const int x = (axis + 1) % 3, y = (axis + 2) % 3;
  const bool has = has_centre(t, x, y, axis, centre_of(cell[static_cast<size_t>(x)]),
                              centre_of(cell[static_cast<size_t>(y)]));
  return has ? thin_line(t, axis, cell) : Cells{};
}

using Line = Cells (*)(const Snapped&, int, const std::array<int, 3>&);

bool occupies(const Snapped& t, const std::array<int, 3>& cell, Line line) {
  for (int axis = 0; axis < 3; ++axis) {
    const Cells cells = line(t, axis, cell);
    const int at = cell[static_cast<size_t>(axis)];
    if (cells.first <= at && at <= cells.last) return true;
  }
  return false;
}

size_t cell_index(const OracleGrid& grid, const std::array<int, 3>& p) {
  return static_cast<size_t>(p[0]) +
         static_cast<size_t>(grid.dims[0]) *
             (static_cast<size_t>(p[1]) +
              static_cast<size_t>(grid.dims[1]) * static_cast<size_t>(p[2]));
}

// `first`, `last`: cells that may be occupied.
void add_lines(const Snapped& t, int axis, std::array<int, 3> first, std::array<int, 3> last,
               const OracleGrid& grid, Line line, Occupancy& cells) {
  const auto x = static_cast<size_t>(axis + 1) % 3, y = static_cast<size_t>(axis + 2) % 3;
  const auto z = static_cast<size_t>(axis);
  std::array<int, 3> at = first;
  for (at[y] = first[y]; at[y] <= last[y]; ++at[y]) {
    for (at[x] = first[x]; at[x] <= last[x]; ++at[x]) {
      const Cells found = line(t, axis, at);
      for (int64_t k = found.first; k <= found.last; ++k) {
        if (k < 0 || k >= grid.dims[z]) continue;
        std::array<int, 3> cell = at;
        cell[z] = static_cast<int>(k);
        cells[cell_index(grid, cell)] = 1;
      }
    }
  }
}

Occupancy cells_by(const std::vector<Triangle>& triangles, const OracleGrid& grid, Line line) {
  Occupancy cells(static_cast<size_t>(grid.dims[0]) * grid.dims[1] * grid.dims[2]);
  for (const Triangle& triangle : triangles) {
    Snapped snapped{};
    std::array<int, 3> first{}, last{};
    for (size_t c = 0; c < 3; ++c) {
      for (size_t i = 0; i < 3; ++i) {
        const double p_grid = (triangle[i][c] - grid.origin[c]) / grid.voxel_size[c];
        snapped[i][c] = snap_512(p_grid, grid.dims[c]);
      }
      const auto [low, high] = std::minmax({snapped[0][c], snapped[1][c], snapped[2][c]});
      // One cell more on each side than needed: the test decides, not the loop.
      first[c] = static_cast<int>(std::max<int64_t>(0, low / 512 - 1));
      last[c] = static_cast<int>(std::min<int64_t>(grid.dims[c] - 1, high / 512 + 1));
    }
    for (int axis = 0; axis < 3; ++axis) add_lines(snapped, axis, first, last, grid, line, cells);
  }
  return cells;
}

}  // namespace

bool occupies_thin(const Snapped& triangle_512, const std::array<int, 3>& cell) {
  return occupies(triangle_512, cell, thin_line);
}

bool occupies_center(const Snapped& triangle_512, const std::array<int, 3>& cell) {
  return occupies(triangle_512, cell, center_line);
}

Occupancy thin_cells(const std::vector<Triangle>& triangles, const OracleGrid& grid) {
  return cells_by(triangles, grid, thin_line);
}

Occupancy center_cells(const std::vector<Triangle>& triangles, const OracleGrid& grid) {
  return cells_by(triangles, grid, center_line);
}

bool is_enclosed(const Occupancy& occupancy, const OracleGrid& grid,
                 const std::array<int, 3>& from) {
  Occupancy seen = occupancy;
  if (seen[cell_index(grid, from)] != 0) std::abort();
  std::vector<std::array<int, 3>> open = {from};
  seen[cell_index(grid, from)] = 1;
  while (!open.empty()) {
    const std::array<int, 3> at = open.back();
    open.pop_back();
    for (size_t c = 0; c < 3; ++c) {
      if (at[c] == 0 || at[c] == grid.dims[c] - 1) return false;
      for (const int step : {-1, 1}) {
        std::array<int, 3> next = at;
        next[c] += step;
        if (seen[cell_index(grid, next)] != 0) continue;
        seen[cell_index(grid, next)] = 1;
        open.push_back(next);
      }
    }
  }
  return true;
}

}  // namespace voxeld::reference
