#include "server/base/cancel_point.h"

namespace voxeld::internal {

constinit thread_local const std::atomic<bool>* cancel_flag = nullptr;

}  // namespace voxeld::internal
