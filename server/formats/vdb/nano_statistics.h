// Statistics of the active voxels below a node of a NanoVDB grid.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "server/formats/vdb/bytes.h"
#include "server/formats/vdb/grid_values.h"

namespace voxeld::vdb {

// The number that stands for a value.
inline double measure_of(float value) {
  return value;
}
inline double measure_of(int32_t value) {
  return value;
}
inline double measure_of(const Vec3s& value) {
  const double x = value[0], y = value[1], z = value[2];
  return x * x + y * y + z * z;
}

// Sums, so that parts that are added in the same order give the same bits. Squares of floats are
// exact in double precision, so it does not matter whether a compiler contracts these expressions.
template <typename Value>
class NanoStatistics {
 public:
  // voxels: how many have the value.
  void add(const Value& value, uint64_t voxels = 1) {
    const double measure = measure_of(value);
    const auto times = static_cast<double>(voxels);
    add({value, value, measure, measure, measure * times, measure * measure * times, voxels});
  }
  void add(const NanoStatistics& other) {
    if (other.voxels_ == 0) return;
    if (voxels_ == 0 || other.low_ < low_) {
      low_ = other.low_;
      min_ = other.min_;
    }
    if (voxels_ == 0 || other.high_ > high_) {
      high_ = other.high_;
      max_ = other.max_;
    }
    sum_ += other.sum_;
    square_sum_ += other.square_sum_;
    voxels_ += other.voxels_;
  }

  const Value& min() const { return min_; }
  const Value& max() const { return max_; }
  float mean() const { return static_cast<float>(exact_mean()); }
  float deviation() const {
    if (voxels_ == 0 || low_ == high_) return 0;  // else the rounding of the sums would show
    const double mean = exact_mean();
    const double variance = std::fma(-mean, mean, square_sum_ / static_cast<double>(voxels_));
    return static_cast<float>(std::sqrt(std::max(variance, 0.0)));
  }

  NanoStatistics() = default;
  // A grid without voxels has its background for both.
  static NanoStatistics of_none(const Value& background) {
    NanoStatistics none;
    none.min_ = none.max_ = background;
    return none;
  }

 private:
  NanoStatistics(const Value& min, const Value& max, double low, double high, double sum,
                 double square_sum, uint64_t voxels)
      : min_(min),
        max_(max),
        low_(low),
        high_(high),
        sum_(sum),
        square_sum_(square_sum),
        voxels_(voxels) {}

  double exact_mean() const {
    return voxels_ == 0 ? 0 : std::clamp(sum_ / static_cast<double>(voxels_), low_, high_);
  }

  Value min_{}, max_{};
  double low_ = 0, high_ = 0;  // their measures
  double sum_ = 0, square_sum_ = 0;
  uint64_t voxels_ = 0;
};

template <typename Value>
void put_statistics(Bytes& out, const NanoStatistics<Value>& statistics) {
  put(out, statistics.min());
  put(out, statistics.max());
  put(out, statistics.mean());
  put(out, statistics.deviation());
}

}  // namespace voxeld::vdb
