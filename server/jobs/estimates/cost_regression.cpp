#include "server/jobs/estimates/cost_regression.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "proto/text/client_texts.h"
#include "proto/text/number_text.h"

namespace voxeld {
namespace {

constexpr double kSideUnit = 256.0, kBytesUnit = 1048576.0;
// Weight of the prior, in observations. How costs grow is known better than how fast a machine is.
constexpr std::array<double, 3> kPriorWeights = {0.2, 4.0, 4.0};
// An observation counts half after about 140 others.
constexpr double kFading = 0.995;
// Until jobs have shown how far off predictions are: by a factor of e^0.7.
constexpr double kPriorVariance = 0.5, kPriorVarianceWeight = 4.0;
constexpr double kVarianceMin = 0.0025;  // 5 %: clocks and caches
constexpr double kFourOfFive = 1.2816;   // standard deviations

}  // namespace

CostRegression::CostRegression() {
  for (size_t i = 0; i < kTerms; ++i) precision_[i][i] = kPriorWeights[i];
}

CostRegression::Vector CostRegression::terms(const CostFeatures& features) {
  return {1.0, std::log(std::max(features.side, 1.0) / kSideUnit),
          std::log(std::max(features.input_bytes, 1.0) / kBytesUnit)};
}

// By cofactors: 3 x 3, symmetric, positive definite by its prior.
CostRegression::Matrix CostRegression::inverse_precision() const {
  const Matrix& m = precision_;
  Matrix inverse{};
  const auto minor = [&m](size_t i, size_t j) {
    const size_t a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
    return m[a][c] * m[b][d] - m[a][d] * m[b][c];
  };
  const double determinant = m[0][0] * minor(0, 0) + m[0][1] * minor(0, 1) + m[0][2] * minor(0, 2);
  for (size_t i = 0; i < kTerms; ++i) {
    for (size_t j = 0; j < kTerms; ++j) inverse[j][i] = minor(i, j) / determinant;
  }
  return inverse;
}

void CostRegression::observe(const CostFeatures& features, double factor) {
  if (!(factor > 0) || !std::isfinite(factor)) return;
  const Vector x = terms(features);
  const double y = std::log(factor);
  const double error = y - std::log(predict(features).expected);
  residual_ = kFading * residual_ + error * error;
  weight_ = kFading * weight_ + 1.0;
  // The estimate decays towards the prior.
  for (size_t i = 0; i < kTerms; ++i) {
    for (size_t j = 0; j < kTerms; ++j) {
      const double prior = i == j ? kPriorWeights[i] : 0.0;
      precision_[i][j] = kFading * precision_[i][j] + (1 - kFading) * prior + x[i] * x[j];
    }
    moment_[i] = kFading * moment_[i] + x[i] * y;
  }
  ++observations_;
}

CostRange CostRegression::predict(const CostFeatures& features) const {
  const Matrix inverse = inverse_precision();
  const Vector x = terms(features);
  double log_factor = 0, spread = 1;
  for (size_t i = 0; i < kTerms; ++i) {
    for (size_t j = 0; j < kTerms; ++j) {
      log_factor += x[i] * inverse[i][j] * moment_[j];
      spread += x[i] * inverse[i][j] * x[j];
    }
  }
  const double noise = std::max(kVarianceMin, (kPriorVariance * kPriorVarianceWeight + residual_) /
                                                  (kPriorVarianceWeight + weight_));
  const double deviation = std::min(kFourOfFive * std::sqrt(noise * spread), 10.0);
  const double expected = std::exp(log_factor);
  return {expected, expected * std::exp(-deviation), expected * std::exp(deviation)};
}

std::string CostRegression::text() const {
  std::string out = std::to_string(observations_);
  const auto add = [&out](double value) {
    std::array<char, 40> buffer{};
    const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
    out += ' ';
    out.append(buffer.data(), end);
  };
  add(residual_);
  add(weight_);
  for (const double value : moment_) add(value);
  for (const Vector& row : precision_) {
    for (const double value : row) add(value);
  }
  return out;
}

Status CostRegression::parse(std::string_view text) {
  const Error broken{ErrorCode::kInternal, "learned costs", "15 numbers", echoed(text)};
  std::vector<double> numbers;
  while (!text.empty()) {
    const std::string_view word = text.substr(0, text.find(' '));
    text.remove_prefix(std::min(text.size(), word.size() + 1));
    const auto value = parse_number<double>(word);
    if (!value || !std::isfinite(*value)) return broken;
    numbers.push_back(*value);
  }
  if (numbers.size() != 3 + kTerms + kTerms * kTerms || numbers[0] < 0) return broken;
  CostRegression read = *this;
  read.observations_ = static_cast<int64_t>(numbers[0]);
  read.residual_ = numbers[1];
  read.weight_ = numbers[2];
  for (size_t i = 0; i < kTerms; ++i) {
    read.moment_[i] = numbers[3 + i];
    for (size_t j = 0; j < kTerms; ++j) {
      read.precision_[i][j] = numbers[3 + kTerms + i * kTerms + j];
    }
  }
  const CostRange tried = read.predict({});
  if (!std::isfinite(tried.expected) || !(tried.low > 0)) return broken;
  *this = read;
  return {};
}

}  // namespace voxeld
