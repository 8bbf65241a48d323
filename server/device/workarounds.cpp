#include "server/device/workarounds.h"

#include <array>
#include <cstdlib>

namespace voxeld::gpu {
namespace {

constexpr std::array kWorkarounds = {
    WorkaroundInfo{Workaround::kLoopIterations65535, "loop_iterations_65535",
                   "work is split so that no shader loops more than 65,535 times"},
    WorkaroundInfo{Workaround::kZinkStaleUniforms, "zink_stale_uniforms",
                   "ZINK_INLINE_UNIFORMS=0 while Zink is loaded"},
    WorkaroundInfo{Workaround::kTimerQueryZero, "timer_query_zero",
                   "passes are timed by wall clock on software drivers"},
    WorkaroundInfo{Workaround::kLpVectorWidth512, "lp_vector_width_512",
                   "LP_NATIVE_VECTOR_WIDTH=512 is ignored"},
};

}  // namespace

std::span<const WorkaroundInfo> all_workarounds() {
  return kWorkarounds;
}

bool workaround_enabled(Workaround workaround, std::string_view list) {
  const std::string_view name = kWorkarounds[static_cast<size_t>(workaround)].name;
  while (!list.empty()) {
    const size_t comma = list.find(',');
    const std::string_view item = list.substr(0, comma);
    if (item.size() == name.size() + 1 && item.front() == '-' && item.substr(1) == name) {
      return false;
    }
    list = comma == std::string_view::npos ? std::string_view{} : list.substr(comma + 1);
  }
  return true;
}

bool workaround_enabled(Workaround workaround) {
  const char* list = std::getenv("VOXELD_WORKAROUNDS");
  return list == nullptr || workaround_enabled(workaround, list);
}

}  // namespace voxeld::gpu
