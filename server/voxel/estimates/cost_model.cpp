#include "server/voxel/estimates/cost_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace voxeld {
namespace {

constexpr size_t kTrianglesRead = 1 << 12;
constexpr size_t kTerms = 4;
using Terms = std::array<double, kTerms>;

// Terms in the units of CostModel's numbers, so that the model is their dot product.
Terms terms_of(const Workload& work) {
  return {1.0, work.tiles, 1e-6 * work.triangles, 1e-6 * work.columns};
}

double dot(const Terms& a, const Terms& b) {
  double sum = 0;
  for (size_t i = 0; i < kTerms; ++i) sum += a[i] * b[i];
  return sum;
}

// Least squares with only the terms of `used` (one bit each); the others are 0. It solves the
// normal equations by Gauss-Jordan elimination with pivoting. Returns false if they are singular.
bool solve(std::span<const Terms> rows, unsigned used, Terms& solution) {
  std::vector<size_t> columns;
  for (size_t i = 0; i < kTerms; ++i) {
    if ((used >> i & 1u) != 0) columns.push_back(i);
  }
  const size_t n = columns.size();
  std::array<std::array<double, kTerms + 1>, kTerms> m{};
  for (const Terms& row : rows) {
    for (size_t i = 0; i < n; ++i) {
      for (size_t j = 0; j < n; ++j) m[i][j] += row[columns[i]] * row[columns[j]];
      m[i][n] += row[columns[i]];  // the right side of every row is 1
    }
  }
  for (size_t i = 0; i < n; ++i) {
    size_t pivot = i;
    for (size_t k = i + 1; k < n; ++k) {
      if (std::abs(m[k][i]) > std::abs(m[pivot][i])) pivot = k;
    }
    if (std::abs(m[pivot][i]) < 1e-300) return false;
    std::swap(m[i], m[pivot]);
    for (size_t k = 0; k < n; ++k) {
      if (k == i) continue;
      const double factor = m[k][i] / m[i][i];
      for (size_t j = i; j <= n; ++j) m[k][j] -= factor * m[i][j];
    }
  }
  solution = {};
  for (size_t i = 0; i < n; ++i) solution[columns[i]] = m[i][n] / m[i][i];
  return true;
}

double squared_error(std::span<const Terms> rows, const Terms& solution) {
  double sum = 0;
  for (const Terms& row : rows) sum += std::pow(dot(row, solution) - 1.0, 2);
  return sum;
}

// Tries all 2^4 choices of nonzero terms. The best solution without a negative term is the least
// squares under that condition.
Terms non_negative_least_squares(std::span<const Terms> rows) {
  Terms best{};
  double best_error = squared_error(rows, best);
  for (unsigned used = 1; used < 1u << kTerms; ++used) {
    Terms solution;
    if (!solve(rows, used, solution)) continue;
    if (std::any_of(solution.begin(), solution.end(),
                    [](double v) { return !(v >= 0) || !std::isfinite(v); })) {
      continue;
    }
    const double error = squared_error(rows, solution);
    if (error < best_error) {
      best = solution;
      best_error = error;
    }
  }
  return best;
}

double median_error(const CostModel& model, std::span<const CostSample> samples) {
  std::vector<double> errors;
  errors.reserve(samples.size());
  for (const CostSample& sample : samples) {
    errors.push_back(std::abs(model.predict_ms(sample.work) - sample.ms) / sample.ms);
  }
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  return *middle;
}

}  // namespace

Workload estimate_workload(const SnappedMesh& mesh, std::span<const TileBin> bins) {
  Workload work;
  work.tiles = static_cast<double>(bins.size());
  for (const TileBin& bin : bins) work.triangles += static_cast<double>(bin.triangles.size());
  const size_t count = mesh.triangles.size();
  const size_t step = std::max<size_t>(1, count / kTrianglesRead);
  const double cell = std::ldexp(1.0, -limits::kSubVoxelBits);
  size_t read = 0;
  for (size_t t = 0; t < count; t += step, ++read) {
    const auto& v = mesh.triangles[t].vertices;
    const glm::ivec3 &a = mesh.vertices[v[0]], &b = mesh.vertices[v[1]], &c = mesh.vertices[v[2]];
    const glm::ivec3 extent = glm::max(a, glm::max(b, c)) - glm::min(a, glm::min(b, c));
    const glm::dvec3 sides = cell * glm::dvec3(extent) + 1.0;
    work.columns += sides.x * sides.y * sides.z / std::min({sides.x, sides.y, sides.z});
  }
  if (read > 0) work.columns *= static_cast<double>(count) / static_cast<double>(read);
  return work;
}

double CostModel::predict_ms(const Workload& work) const {
  return dot({job_ms, tile_ms, triangle_ns, column_ns}, terms_of(work));
}

Result<CostModel> fit_cost_model(std::span<const CostSample> samples) {
  if (samples.size() < kTerms) {
    return Error{ErrorCode::kInternal, "too few measurements for a cost model",
                 "at least " + std::to_string(kTerms), std::to_string(samples.size())};
  }
  std::vector<Terms> rows;  // divided by the measured time, so that errors are relative
  for (const CostSample& sample : samples) {
    if (!(sample.ms > 0) || !std::isfinite(sample.ms)) {
      return Error{ErrorCode::kInternal, "a measured time is no time", "more than 0 ms",
                   std::to_string(sample.ms)};
    }
    Terms row = terms_of(sample.work);
    for (double& term : row) term /= sample.ms;
    rows.push_back(row);
  }
  const Terms fitted = non_negative_least_squares(rows);
  CostModel model{fitted[0], fitted[1], fitted[2], fitted[3]};
  model.error = median_error(model, samples);
  return model;
}

}  // namespace voxeld
