#include "server/base/cancel_point.h"

#include "proto/work_point.h"

namespace voxeld::internal {

constinit thread_local const CancelScope* cancel_scope = nullptr;

namespace {
[[maybe_unused]] const bool has_work_points = [] {
  work_point_function = [] { cancel_point(); };
  return true;
}();
}  // namespace

}  // namespace voxeld::internal
