// A model of the cost of jobs, learned from those that ended: a line in logarithms,
// cost = e^a side^b bytes^c frames. The coefficients start at a prior and move with each
// observation.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "proto/result.h"

namespace voxeld {

// The features of a request that its cost depends on.
struct CostFeatures {
  double side = 128;       // voxels or pixels along the longest side
  double input_bytes = 1;  // of the asset or grid
  double frames = 1;       // of a sequence
};

struct CostRange {
  double expected = 0;
  double low = 0, high = 0;  // four of five jobs are expected between them
};

// Bayesian linear regression with a normal prior (Bishop 2006, Pattern Recognition and Machine
// Learning, section 3.3), of the logarithm of one quantity. Old observations fade, so that a new
// device or driver is learned within some hundred jobs.
class CostRegression {
 public:
  // Coefficients of log(side / 256), log(bytes / 1 MiB), and the cost at those.
  struct Guess {
    double cost = 1.0, side_exponent = 2.0, bytes_exponent = 0.3;
  };
  explicit CostRegression(const Guess& guess);

  // `cost` of all frames together. Costs that are not positive are ignored.
  void observe(const CostFeatures& features, double cost);
  CostRange predict(const CostFeatures& features) const;
  int64_t observations() const { return observations_; }

  // A text that parse() of the same guess takes up. Errors of parse(): internal.
  std::string text() const;
  Status parse(std::string_view text);

 private:
  static constexpr size_t kTerms = 3;
  using Vector = std::array<double, kTerms>;
  using Matrix = std::array<Vector, kTerms>;
  static Vector terms(const CostFeatures& features);
  Matrix inverse_precision() const;

  Vector prior_mean_{};
  Matrix precision_{};                // of the coefficients, in units of 1 / noise variance
  Vector moment_{};                   // precision times mean
  double residual_ = 0, weight_ = 0;  // fading sum of squared errors of predictions, and its weight
  int64_t observations_ = 0;
};

}  // namespace voxeld
