// The floor's darkness in a band of an image's rows. It varies slowly over most of the floor, and
// a value takes dozens of rays: where the corners and the middle of a cell of pixels agree, the
// others are interpolated.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace voxeld {

class GroundCells {
 public:
  static constexpr int kSide = 8;  // pixels of the largest cell, and rows of a band
  // Values of a cell of `side` pixels that differ by no more are taken for a slope: half a level of
  // 255 in a picture, and in the smallest cells two, the step of one ray in RAYMARCH_GROUND_RAYS.
  static constexpr float same(int side) { return 0.04f / static_cast<float>(side); }

  explicit GroundCells(int width);

  // Begins a band, in which nothing is wanted.
  void begin();
  void want(int x, int row) { wanted_[index(x, row)] = 1; }
  // Finds the wanted values, and others. at(x, row): one of them, at most a cell beyond the image.
  template <typename At>
  void find(const At& at) {
    for (int x = 0; x < width_; x += kSide) fill(x, 0, kSide, at);
  }
  bool is_wanted(int x, int row) const { return wanted_[index(x, row)] != 0; }
  float value(int x, int row) const { return values_[index(x, row)]; }

 private:
  static constexpr float kUnknown = -1.0f;

  size_t index(int x, int row) const {
    return static_cast<size_t>(row) * static_cast<size_t>(stride_) + static_cast<size_t>(x);
  }
  // Where there is no shadow at all, a transparent background stays as it is.
  static bool is_same(float low, float high, int side) {
    return high - low <= same(side) && (low > 0.0f || high == 0.0f);
  }
  bool has_wanted(int x0, int row0, int side) const;
  void interpolate(int x0, int row0, int side);

  template <typename At>
  float known(int x, int row, const At& at) {
    float& value = values_[index(x, row)];
    if (value == kUnknown) value = at(x, row);
    return value;
  }
  template <typename At>
  void fill(int x0, int row0, int side, const At& at) {
    if (!has_wanted(x0, row0, side)) return;
    if (side == 1) {
      known(x0, row0, at);
      return;
    }
    const int x1 = x0 + side, row1 = row0 + side, half = side / 2;
    const float a = known(x0, row0, at), b = known(x1, row0, at);
    const float c = known(x0, row1, at), d = known(x1, row1, at);
    const float lowest = std::min({a, b, c, d}), highest = std::max({a, b, c, d});
    if (is_same(lowest, highest, side)) {
      if (side == 2) return interpolate(x0, row0, side);
      const float middle = known(x0 + half, row0 + half, at);
      if (is_same(std::min(lowest, middle), std::max(highest, middle), side)) {
        return interpolate(x0, row0, side);
      }
    }
    for (const int x : {x0, x0 + half}) {
      for (const int row : {row0, row0 + half}) fill(x, row, half, at);
    }
  }

  int width_, stride_;
  std::vector<float> values_;  // kSide + 1 rows of pixels
  std::vector<char> wanted_;
};

}  // namespace voxeld
