#include "server/render/gif_palette.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"

namespace voxeld {
namespace {

constexpr size_t kColorsMax = 256;
using Color = std::array<uint8_t, 3>;

// A histogram's cells have the upper 5 bits of each channel.
constexpr int kCellBits = 5;
constexpr size_t kCellCount = size_t{1} << (3 * kCellBits);

size_t cell_of(const Color& color, int bits = kCellBits) {
  const int drop = 8 - bits;
  return static_cast<size_t>(color[0] >> drop) << (2 * bits) |
         static_cast<size_t>(color[1] >> drop) << bits | static_cast<size_t>(color[2] >> drop);
}

// Pixels of a cell, or of several.
struct Sum {
  double count = 0.0;
  std::array<double, 3> first{}, second{};  // sums of the channels and of their squares

  void add(const Color& color) {
    count += 1.0;
    for (size_t c = 0; c < 3; ++c) {
      first[c] += color[c];
      second[c] += double{1} * color[c] * color[c];
    }
  }
  void add(const Sum& other) {
    count += other.count;
    for (size_t c = 0; c < 3; ++c) {
      first[c] += other.first[c];
      second[c] += other.second[c];
    }
  }
  double mean(size_t c) const { return first[c] / count; }
  // The squared error of a channel if all pixels had the mean.
  double error(size_t c) const { return second[c] - first[c] * mean(c); }
};

// A range of cells that gets one colour.
struct Box {
  size_t begin = 0, end = 0;
  Sum sum;
  size_t axis = 0;     // channel with the largest error
  double error = 0.0;  // of that channel; 0 for a single cell

  Box(const std::vector<Sum>& cells, size_t from, size_t to) : begin(from), end(to) {
    for (size_t i = begin; i < end; ++i) sum.add(cells[i]);
    if (end - begin < 2) return;
    for (size_t c = 0; c < 3; ++c) {
      if (sum.error(c) > error) {
        error = sum.error(c);
        axis = c;
      }
    }
  }
};

// Sorts a box's cells into two parts, the first with means below the box's. Returns the begin of
// the second.
size_t split(std::vector<Sum>& cells, const Box& box) {
  const auto begin = cells.begin() + static_cast<ptrdiff_t>(box.begin);
  const auto end = cells.begin() + static_cast<ptrdiff_t>(box.end);
  const size_t axis = box.axis;
  const double middle = box.sum.mean(axis);
  const auto at =
      std::partition(begin, end, [&](const Sum& cell) { return cell.mean(axis) < middle; });
  return static_cast<size_t>(at - cells.begin());
}

std::vector<Color> median_cut(std::span<const uint8_t> rgb) {
  std::vector<Sum> histogram(kCellCount);
  for (size_t i = 0; i < rgb.size(); i += 3) {
    cancel_point_at(i);
    const Color color{rgb[i], rgb[i + 1], rgb[i + 2]};
    histogram[cell_of(color)].add(color);
  }
  std::vector<Sum> cells;
  for (const Sum& cell : histogram) {
    if (cell.count > 0.0) cells.push_back(cell);
  }
  std::vector<Box> boxes{Box(cells, 0, cells.size())};
  while (boxes.size() < kColorsMax) {
    const auto worst = std::max_element(
        boxes.begin(), boxes.end(), [](const Box& a, const Box& b) { return a.error < b.error; });
    if (worst->error <= 0.0) break;
    const size_t middle = split(cells, *worst);
    if (middle == worst->begin || middle == worst->end) {
      worst->error = 0.0;  // within its cells, whose means are equal: other boxes have the room
      continue;
    }
    const Box upper(cells, middle, worst->end);
    *worst = Box(cells, worst->begin, middle);
    boxes.push_back(upper);
  }
  std::vector<Color> palette;
  for (const Box& box : boxes) {
    Color color;
    for (size_t c = 0; c < 3; ++c) color[c] = static_cast<uint8_t>(std::lround(box.sum.mean(c)));
    palette.push_back(color);
  }
  return palette;
}

// The nearest entries of a palette, by the squared distance of sRGB. Colours of the same upper 6
// bits have the entry of the first of them.
class NearestEntry {
 public:
  explicit NearestEntry(const std::vector<Color>& palette)
      : palette_(palette), known_(size_t{1} << (3 * kKeyBits), kUnknown) {}

  uint8_t find(const Color& color) {
    uint16_t& known = known_[cell_of(color, kKeyBits)];
    if (known == kUnknown) known = search(color);
    return static_cast<uint8_t>(known);
  }

 private:
  static constexpr int kKeyBits = 6;
  static constexpr uint16_t kUnknown = kColorsMax;

  uint16_t search(const Color& color) const {
    int least = std::numeric_limits<int>::max();
    size_t best = 0;
    for (size_t i = 0; i < palette_.size(); ++i) {
      int distance = 0;
      for (size_t c = 0; c < 3; ++c) {
        const int apart = int{color[c]} - palette_[i][c];
        distance += apart * apart;
      }
      if (distance < least) {
        least = distance;
        best = i;
      }
    }
    return static_cast<uint16_t>(best);
  }

  const std::vector<Color>& palette_;
  std::vector<uint16_t> known_;
};

std::vector<uint8_t> dither(std::span<const uint8_t> rgb, size_t width,
                            const std::vector<Color>& palette) {
  NearestEntry nearest(palette);
  std::vector<uint8_t> indices(rgb.size() / 3);
  // Errors in 1/16 of a level, with one pixel more at both ends.
  std::vector<std::array<int, 3>> now(width + 2), next(width + 2);
  for (size_t i = 0; i < indices.size(); ++i) {
    const size_t x = i % width;
    if (x == 0) {
      cancel_point();
      if (i > 0) now.swap(next);
      std::fill(next.begin(), next.end(), std::array<int, 3>{});
    }
    Color wanted;
    for (size_t c = 0; c < 3; ++c) {
      wanted[c] = static_cast<uint8_t>(std::clamp(rgb[3 * i + c] + now[x + 1][c] / 16, 0, 255));
    }
    indices[i] = nearest.find(wanted);
    for (size_t c = 0; c < 3; ++c) {
      const int error = int{wanted[c]} - palette[indices[i]][c];
      now[x + 2][c] += 7 * error;
      next[x][c] += 3 * error;
      next[x + 1][c] += 5 * error;
      next[x + 2][c] += error;
    }
  }
  return indices;
}

// The image with exactly its colours; nullopt if there are too many.
std::optional<IndexedImage> keep_colors(std::span<const uint8_t> rgb) {
  IndexedImage image;
  std::vector<Color> colors;
  Color last{};
  for (size_t i = 0; i < rgb.size(); i += 3) {
    cancel_point_at(i);
    const Color color{rgb[i], rgb[i + 1], rgb[i + 2]};
    if (i > 0 && color == last) continue;
    last = color;
    const auto at = std::lower_bound(colors.begin(), colors.end(), color);
    if (at != colors.end() && *at == color) continue;
    if (colors.size() == kColorsMax) return std::nullopt;
    colors.insert(at, color);
  }
  image.indices.reserve(rgb.size() / 3);
  for (size_t i = 0; i < rgb.size(); i += 3) {
    cancel_point_at(i);
    const Color color{rgb[i], rgb[i + 1], rgb[i + 2]};
    const auto at = std::lower_bound(colors.begin(), colors.end(), color);
    image.indices.push_back(static_cast<uint8_t>(at - colors.begin()));
  }
  image.palette = std::move(colors);
  return image;
}

}  // namespace

IndexedImage reduce_colors(std::span<const uint8_t> rgb, int width) {
  if (std::optional<IndexedImage> exact = keep_colors(rgb)) return *std::move(exact);
  IndexedImage image{.palette = median_cut(rgb), .indices = {}};
  image.indices = dither(rgb, static_cast<size_t>(width), image.palette);
  return image;
}

}  // namespace voxeld
