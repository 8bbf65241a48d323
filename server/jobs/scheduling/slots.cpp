#include "server/jobs/scheduling/slots.h"

#include <algorithm>
#include <cstddef>
#include <tuple>

#include "server/base/check.h"

namespace voxeld {
namespace {

bool may_take_last_slot(const QueueHead& head, const std::vector<StartedJob>& started) {
  return std::all_of(started.begin(), started.end(), [&](const StartedJob& job) {
    return job.tenant != head.tenant || is_more_urgent(head, job);
  });
}

}  // namespace

bool is_more_urgent(const QueueHead& head, const StartedJob& job) {
  return std::tuple(-head.priority, head.deadline_ms) < std::tuple(-job.priority, job.deadline_ms);
}

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

bool can_run(const std::vector<IdleSlot>& idle, WorkerIsolation isolation, const QueueHead& head) {
  return std::any_of(idle.begin(), idle.end(), [&](const IdleSlot& slot) {
    return slot.past.may_run(isolation, head.tenant, head.input_tenant);
  });
}

HeadChoice pick_runnable_head(const std::vector<QueueHead>& heads,
                              const std::vector<IdleSlot>& idle, size_t free_slots,
                              const std::vector<StartedJob>& started, WorkerIsolation isolation,
                              const std::function<double(const std::string&)>& share) {
  HeadChoice choice;
  std::vector<QueueHead> left = heads;
  std::vector<StartedJob> placed = started;
  while (free_slots > 0) {
    const auto best = pick_head(left, free_slots, placed, share);
    if (!best) return choice;
    const QueueHead head = left[*best];
    if (can_run(idle, isolation, head)) {
      const auto it = std::find_if(heads.begin(), heads.end(),
                                   [&](const QueueHead& other) { return other.seq == head.seq; });
      choice.head = static_cast<size_t>(it - heads.begin());
      return choice;
    }
    ++choice.blocked;
    --free_slots;
    placed.emplace_back().tenant = head.tenant;
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(*best));
  }
  return choice;
}

std::vector<int64_t> workers_to_replace(std::vector<IdleSlot> idle, WorkerIsolation isolation,
                                        int fresh_wanted, int fresh_coming) {
  const auto fresh = std::count_if(idle.begin(), idle.end(),
                                   [](const IdleSlot& slot) { return slot.past.is_fresh(); });
  int64_t missing = fresh_wanted - fresh_coming - fresh;
  std::erase_if(idle, [](const IdleSlot& slot) { return slot.past.is_fresh(); });
  std::sort(idle.begin(), idle.end(),
            [](const IdleSlot& a, const IdleSlot& b) { return a.ended_at < b.ended_at; });
  std::vector<int64_t> replaced;
  for (const IdleSlot& slot : idle) {
    if (!slot.past.is_used_up(isolation)) continue;
    replaced.push_back(slot.connection);
    --missing;
  }
  for (const IdleSlot& slot : idle) {
    if (missing <= 0) break;
    if (slot.past.is_used_up(isolation)) continue;
    replaced.push_back(slot.connection);
    --missing;
  }
  return replaced;
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
