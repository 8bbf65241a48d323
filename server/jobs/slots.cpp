#include "server/jobs/slots.h"

#include <algorithm>
#include <tuple>

#include "server/base/check.h"

namespace voxeld {
namespace {

bool may_take_last_slot(const QueueHead& head, const std::vector<StartedJob>& started) {
  return std::all_of(started.begin(), started.end(), [&](const StartedJob& job) {
    return job.tenant != head.tenant || job.priority < head.priority;
  });
}

}  // namespace

std::optional<size_t> pick_head(const std::vector<QueueHead>& heads, size_t free_slots,
                                const std::vector<StartedJob>& started,
                                const std::function<double(const std::string&)>& share) {
  std::optional<size_t> best;
  std::tuple<double, int64_t> best_order;
  for (size_t i = 0; i < heads.size(); ++i) {
    if (free_slots <= 1 && !may_take_last_slot(heads[i], started)) continue;
    const std::tuple order(share(heads[i].tenant), heads[i].seq);
    if (best && best_order <= order) continue;
    best = i;
    best_order = order;
  }
  return best;
}

size_t pick_slot(const std::vector<IdleSlot>& idle, std::string_view tenant,
                 std::string_view input) {
  VOXELD_CHECK(!idle.empty(), "a job is claimed for a worker that waits");
  const auto merit = [&](const IdleSlot& slot) {
    const bool is_own = slot.ended_at > 0 && slot.tenant == tenant;
    const bool has_input =
        is_own && std::find(slot.has.begin(), slot.has.end(), input) != slot.has.end();
    return std::tuple(has_input, is_own ? slot.ended_at : 0, -slot.slot);
  };
  const auto best =
      std::max_element(idle.begin(), idle.end(),
                       [&](const IdleSlot& a, const IdleSlot& b) { return merit(a) < merit(b); });
  return static_cast<size_t>(best - idle.begin());
}

}  // namespace voxeld
