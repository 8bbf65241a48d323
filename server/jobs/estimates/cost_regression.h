// How much more jobs cost than was guessed, learned from those that ended: a line in logarithms,
// factor = e^a side^b bytes^c. The coefficients start at 0 and move with each observation.
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
};

// A range of a factor, or of a cost.
struct CostRange {
  double expected = 1;
  double low = 1, high = 1;  // four of five jobs are expected between them
};

// Bayesian linear regression with a normal prior (Bishop 2006, Pattern Recognition and Machine
// Learning, section 3.3), of the logarithm of one factor. Old observations fade, so that a new
// device or driver is learned within some hundred jobs.
class CostRegression {
 public:
  CostRegression();

  // `factor`: the cost over the guess. Factors that are not positive are ignored.
  void observe(const CostFeatures& features, double factor);
  CostRange predict(const CostFeatures& features) const;
  int64_t observations() const { return observations_; }

  // A text that parse() takes up. Errors of parse(): internal.
  std::string text() const;
  Status parse(std::string_view text);

 private:
  static constexpr size_t kTerms = 3;
  using Vector = std::array<double, kTerms>;
  using Matrix = std::array<Vector, kTerms>;
  static Vector terms(const CostFeatures& features);
  Matrix inverse_precision() const;

  Matrix precision_{};                // of the coefficients, in units of 1 / noise variance
  Vector moment_{};                   // precision times mean
  double residual_ = 0, weight_ = 0;  // fading sum of squared errors of predictions, and its weight
  int64_t observations_ = 0;
};

}  // namespace voxeld
