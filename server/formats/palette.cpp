#include "server/formats/palette.h"

#include <algorithm>
#include <cmath>

#include "server/base/pieces.h"
#include "server/grid/color/oklab.h"

namespace voxeld {
namespace {

constexpr int kRefinements = 8;

double linear_from_srgb(double s) {
  return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}

struct Sample {
  uint32_t key;
  double weight;
  Lab lab;
};

struct Cluster {
  size_t first, last;  // of the samples, half-open
  int axis = 0;
  double spread = 0;  // weighted variance along axis: the possible gain of a cut
};

double distance2(const Lab& a, const Lab& b) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c) sum += (a[c] - b[c]) * (a[c] - b[c]);
  return sum;
}

Cluster measured(const std::vector<Sample>& samples, size_t first, size_t last) {
  Cluster cluster{first, last};
  for (size_t c = 0; c < 3; ++c) {
    double weight = 0, sum = 0, square = 0;
    for (size_t i = first; i < last; ++i) {
      cancel_point_at(i);
      const double v = samples[i].lab[c];
      weight += samples[i].weight;
      sum += samples[i].weight * v;
      square += samples[i].weight * v * v;
    }
    const double spread = square - sum * sum / weight;
    if (spread > cluster.spread) {
      cluster.spread = spread;
      cluster.axis = static_cast<int>(c);
    }
  }
  return cluster;
}

// The place that halves the weight along the widest axis. Both parts keep at least one sample.
size_t cut_of(std::vector<Sample>& samples, const Cluster& cluster) {
  const auto axis = static_cast<size_t>(cluster.axis);
  const auto begin = samples.begin() + static_cast<std::ptrdiff_t>(cluster.first);
  const auto end = samples.begin() + static_cast<std::ptrdiff_t>(cluster.last);
  cancellable_sort(begin, end, [&](const Sample& a, const Sample& b) {
    return a.lab[axis] != b.lab[axis] ? a.lab[axis] < b.lab[axis] : a.key < b.key;
  });
  double total = 0, sum = 0;
  for (auto it = begin; it != end; ++it) total += it->weight;
  for (size_t i = cluster.first; i + 1 < cluster.last; ++i) {
    sum += samples[i].weight;
    if (2 * sum >= total) return i + 1;
  }
  return cluster.last - 1;
}

std::vector<Lab> median_cut(std::vector<Sample>& samples, size_t colors_max) {
  std::vector<Cluster> clusters = {measured(samples, 0, samples.size())};
  while (clusters.size() < colors_max) {
    const auto widest = std::ranges::max_element(clusters, {}, &Cluster::spread);
    if (widest->last - widest->first < 2) break;
    const Cluster whole = *widest;
    const size_t cut = cut_of(samples, whole);
    *widest = measured(samples, whole.first, cut);
    clusters.push_back(measured(samples, cut, whole.last));
  }
  std::vector<Lab> centers;
  for (const Cluster& cluster : clusters) {
    Lab sum{};
    double weight = 0;
    for (size_t i = cluster.first; i < cluster.last; ++i) {
      cancel_point_at(i);
      weight += samples[i].weight;
      for (size_t c = 0; c < 3; ++c) sum[c] += samples[i].weight * samples[i].lab[c];
    }
    for (double& v : sum) v /= weight;
    centers.push_back(sum);
  }
  return centers;
}

size_t nearest(const std::vector<Lab>& centers, const Lab& lab) {
  size_t best = 0;
  double best_distance = 1e30;
  for (size_t i = 0; i < centers.size(); ++i) {
    const double d = distance2(centers[i], lab);
    if (d < best_distance) best = i, best_distance = d;
  }
  return best;
}

// The mean of each cluster's colours, taken in linear light, as sRGB.
Rgb mean_color(const std::array<double, 4>& linear_sum) {
  Rgb color{};
  for (size_t c = 0; c < 3; ++c) {
    const double v = linear_sum[3] > 0 ? linear_sum[c] / linear_sum[3] : 0;
    const double s = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
    color[c] = static_cast<uint8_t>(std::lround(255 * std::clamp(s, 0.0, 1.0)));
  }
  return color;
}

}  // namespace

Palette make_palette(const ColorCounts& counts, int colors_max) {
  std::vector<Sample> samples;
  for (const auto& [key, count] : counts) {
    cancel_point();
    push_in_pieces(samples, {key, static_cast<double>(count), oklab(rgb_of(key))});
  }
  cancellable_sort(samples.begin(), samples.end(),
                   [](const Sample& a, const Sample& b) { return a.key < b.key; });
  Palette palette;
  if (samples.size() <= static_cast<size_t>(colors_max)) {
    for (const Sample& sample : samples) {
      palette.index_of[sample.key] = static_cast<uint8_t>(palette.colors.size());
      palette.colors.push_back(rgb_of(sample.key));
    }
    return palette;
  }
  std::vector<Lab> centers = median_cut(samples, static_cast<size_t>(colors_max));
  std::vector<size_t> cluster_of(samples.size());
  for (int round = 0; round < kRefinements; ++round) {
    std::vector<std::array<double, 4>> sums(centers.size());
    for (size_t i = 0; i < samples.size(); ++i) {
      cancel_point_at(i);
      cluster_of[i] = nearest(centers, samples[i].lab);
      auto& sum = sums[cluster_of[i]];
      for (size_t c = 0; c < 3; ++c) sum[c] += samples[i].weight * samples[i].lab[c];
      sum[3] += samples[i].weight;
    }
    for (size_t k = 0; k < centers.size(); ++k) {
      if (sums[k][3] <= 0) continue;
      for (size_t c = 0; c < 3; ++c) centers[k][c] = sums[k][c] / sums[k][3];
    }
  }
  std::vector<std::array<double, 4>> linear(centers.size());
  for (size_t i = 0; i < samples.size(); ++i) {
    cancel_point_at(i);
    auto& sum = linear[cluster_of[i]];
    for (size_t c = 0; c < 3; ++c) {
      sum[c] += samples[i].weight * linear_from_srgb((samples[i].key >> (8 * c) & 255) / 255.0);
    }
    sum[3] += samples[i].weight;
    palette.index_of[samples[i].key] = static_cast<uint8_t>(cluster_of[i]);
  }
  for (const auto& sum : linear) palette.colors.push_back(mean_color(sum));
  return palette;
}

}  // namespace voxeld
