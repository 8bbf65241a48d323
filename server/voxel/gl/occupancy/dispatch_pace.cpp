#include "server/voxel/gl/occupancy/dispatch_pace.h"

#include <algorithm>

namespace voxeld {
namespace {

constexpr double kDispatchNs = 50e6;
// Nanoseconds per column of a slow GPU: some 250 million columns a second, a tenth of that with
// attributes.
constexpr double kSlowColumnNs = 4, kSlowAttributeColumnNs = 40;
// A fit may leave a term out that the samples do not show. No GPU is as fast as this.
constexpr double kColumnNsMin = 1e-3;
// The average is that of some triangles, and a mesh may be made so that they mislead. The estimate
// for an item or triangle is at least this part of the most, so that a dispatch then lasts some
// 0.4 s, still less than what a watchdog waits for.
constexpr double kItemPartMin = 1.0 / 8, kTriangleColumnsMin = 8;
constexpr double kGroupItems = 64;
// Below the counts that 32 bits hold.
constexpr double kCountMax = 1 << 30;

size_t whole_groups(double items) {
  const double groups = std::clamp(items, kGroupItems, kCountMax) / kGroupItems;
  return static_cast<size_t>(groups) * static_cast<size_t>(kGroupItems);
}

}  // namespace

void DispatchPace::begin_job(const CostModel* model, const Workload& work, bool has_attributes) {
  double ns = has_attributes ? kSlowAttributeColumnNs : kSlowColumnNs;
  if (model != nullptr) ns = std::max(model->column_ns, kColumnNsMin);
  columns_ = forced_columns_.value_or(kDispatchNs / ns);
  columns_per_triangle_ = work.triangles > 0 ? work.columns / work.triangles : 0.0;
}

size_t DispatchPace::items(int columns) const {
  const double each = std::clamp(columns_per_triangle_, kItemPartMin * columns, 1.0 * columns);
  return whole_groups(columns_ / each);
}

size_t DispatchPace::triangles() const {
  return whole_groups(columns_ / std::max(columns_per_triangle_, kTriangleColumnsMin));
}

Status DispatchPace::rest() const {
  context_->gl().Finish();
  return pause_ != nullptr && *pause_ ? (*pause_)() : Status();
}

}  // namespace voxeld
