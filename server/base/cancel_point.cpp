#include "server/base/cancel_point.h"

namespace voxeld::internal {

constinit thread_local const CancelScope* cancel_scope = nullptr;

}  // namespace voxeld::internal
