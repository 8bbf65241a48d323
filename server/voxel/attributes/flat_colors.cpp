#include "server/voxel/attributes/flat_colors.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <tuple>

#include "server/grid/color/color_tables.h"
#include "server/voxel/attributes/texture_period.h"

namespace voxeld {
namespace {

// Coordinates are clamped to this many periods. Beyond it their fraction has no precision left.
constexpr double kPeriodsMax = 1 << 14;

int wrapped(int texel, int size, Wrap wrap) {
  if (wrap == Wrap::kClamp) return std::clamp(texel, 0, size - 1);
  const int period = wrap == Wrap::kMirror ? 2 * size : size;
  const int in_period = (texel % period + period) % period;
  return in_period < size ? in_period : period - 1 - in_period;
}

// One axis of a triangle in a texture. Corners are in texels from the centre of texel 0.
class TexelAxis {
 public:
  TexelAxis(std::array<double, 3> u, int size, Wrap wrap) : size_(size) {
    for (double& c : u) c = std::clamp(c, -kPeriodsMax, kPeriodsMax);
    const TexturePeriod period = texture_period(wrap, u);
    wrap_ = period.wrap;
    for (size_t i = 0; i < 3; ++i) corners_[i] = (u[i] - period.below) * size - 0.5;
    const auto [least, most] = std::minmax({corners_[0], corners_[1], corners_[2]});
    is_inside_ = least >= 0.0 && most < size - 1;
  }

  struct Pair {
    int first, second;  // texels
    double fraction;    // weight of the second texel
  };
  Pair at(double w0, double w1, double w2) const {
    const double t = w0 * corners_[0] + w1 * corners_[1] + w2 * corners_[2];
    const auto truncated = static_cast<int>(t);
    const int below = truncated - (truncated > t ? 1 : 0);
    if (is_inside_) return {below, std::min(below + 1, size_ - 1), t - below};
    return {wrapped(below, size_, wrap_), wrapped(below + 1, size_, wrap_), t - below};
  }

 private:
  int size_;
  Wrap wrap_ = Wrap::kClamp;
  std::array<double, 3> corners_{};
  bool is_inside_ = false;  // no tap leaves the image, so none wraps
};

// The bilinear sample in linear light, multiplied by alpha, 65535 for 1.
glm::dvec4 bilinear(const Image& image, const TexelAxis::Pair& x, const TexelAxis::Pair& y) {
  const auto& linear = linear16_from_srgb8();
  const auto width = static_cast<size_t>(image.width);
  const auto texel = [&](int column, int row) {
    const uint8_t* t =
        &image.rgba[4 * (static_cast<size_t>(row) * width + static_cast<size_t>(column))];
    return glm::dvec4(glm::dvec3(linear[t[0]], linear[t[1]], linear[t[2]]) * (t[3] / 255.0),
                      t[3] * 257);
  };
  const glm::dvec4 top =
      texel(x.first, y.first) * (1.0 - x.fraction) + texel(x.second, y.first) * x.fraction;
  const glm::dvec4 bottom =
      texel(x.first, y.second) * (1.0 - x.fraction) + texel(x.second, y.second) * x.fraction;
  return top * (1.0 - y.fraction) + bottom * y.fraction;
}

int taps_along(const std::array<FlatCorner, 3>& corners, const Image& image) {
  const glm::dvec2 size(image.width, image.height);
  double longest = 0.0;
  for (size_t i = 0; i < 3; ++i) {
    const glm::dvec2 side = (corners[(i + 1) % 3].uv - corners[i].uv) * size;
    longest = std::max(longest, side.x * side.x + side.y * side.y);
  }
  int taps = 1;
  while (taps < kFlatTapsMax && longest > 4.0 * taps * taps) ++taps;
  return taps;
}

std::array<uint16_t, 4> rounded(const glm::dvec4& of_65535) {
  std::array<uint16_t, 4> out{};
  for (int c = 0; c < 4; ++c) {
    const double value = of_65535[c] > 0.0 ? std::min(of_65535[c], 65535.0) : 0.0;  // NaN: 0
    out[static_cast<size_t>(c)] = static_cast<uint16_t>(std::floor(value + 0.5));
  }
  return out;
}

}  // namespace

std::array<uint16_t, 4> mean_color(std::array<FlatCorner, 3> corners, const Material* material,
                                   const Image* texture) {
  // NaN is replaced, because the sort below needs an order.
  for (FlatCorner& corner : corners) {
    for (int c = 0; c < 2; ++c) corner.uv[c] = std::isnan(corner.uv[c]) ? 0.0 : corner.uv[c];
    for (int c = 0; c < 4; ++c) {
      corner.color[c] = corner.color[c] > 0.0 ? std::min(corner.color[c], 1.0) : 0.0;
    }
  }
  // The corners are sorted because sums of doubles depend on their order, and the order in the file
  // must not matter.
  std::ranges::sort(corners, {}, [](const FlatCorner& c) {
    return std::tuple(c.uv.x, c.uv.y, c.color.r, c.color.g, c.color.b, c.color.a);
  });
  const FlatCorner &a = corners[0], &b = corners[1], &c = corners[2];
  if (texture == nullptr) return rounded((a.color + b.color + c.color) * (65535.0 / 3.0));
  const int n = taps_along(corners, *texture);
  const TexelAxis x({a.uv.x, b.uv.x, c.uv.x}, texture->width, material->wrap_u);
  const TexelAxis y({a.uv.y, b.uv.y, c.uv.y}, texture->height, material->wrap_v);
  glm::dvec4 sum(0.0);
  for (int i = 0; i < n; ++i) {
    // Centroids of the upright and of the inverted triangles of row i.
    for (int j = 0; j < 2 * (n - i) - 1; ++j) {
      const double shift = j % 2 == 0 ? 1.0 / 3.0 : 2.0 / 3.0;
      const int pair = j / 2;
      const double u = (i + shift) / n, v = (pair + shift) / n, w = 1.0 - u - v;
      sum += (w * a.color + u * b.color + v * c.color) *
             bilinear(*texture, x.at(w, u, v), y.at(w, u, v));
    }
  }
  return rounded(sum / static_cast<double>(n * n));
}

}  // namespace voxeld
