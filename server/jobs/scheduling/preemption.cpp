#include "server/jobs/scheduling/preemption.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <tuple>

namespace voxeld {
namespace {

// For which a job has to work before it is preempted; not positive: it may be.
double seconds_to_preemption(const StartedJob& job) {
  const double worked = job.slot_seconds - job.preparation_seconds;
  const double quantum = std::clamp(kPreemptQuantumShare * job.device_seconds,
                                    kPreemptQuantumSecondsMin, kPreemptQuantumSecondsMax);
  return std::max(quantum, kPreemptPreparations * job.preparation_seconds) - worked;
}

bool contains(const std::vector<size_t>& list, size_t index) {
  return std::find(list.begin(), list.end(), index) != list.end();
}

// Greater ones are preempted first, of one tenant's jobs.
auto least_urgent(const StartedJob& job) {
  return std::tuple(-job.priority, job.deadline_ms, job.seq);
}

// How many workers a tenant keeps beside those that are to be preempted.
size_t kept_by(const PreemptionView& view, const std::string& tenant,
               const std::vector<size_t>& preempted) {
  size_t count = 0;
  for (size_t i = 0; i < view.started.size(); ++i) {
    count += view.started[i].tenant == tenant && !contains(preempted, i) ? 1u : 0u;
  }
  return count;
}

std::vector<const QueueHead*> without_worker(const PreemptionView& view) {
  std::vector<const QueueHead*> waiting;
  for (const QueueHead& head : view.heads) {
    if (kept_by(view, head.tenant, {}) == 0) waiting.push_back(&head);
  }
  std::sort(waiting.begin(), waiting.end(), [&](const QueueHead* a, const QueueHead* b) {
    return std::tuple(view.share(a->tenant), a->seq) < std::tuple(view.share(b->tenant), b->seq);
  });
  return waiting;
}

// The job that is preempted for a tenant with a share of so much.
std::optional<size_t> victim_for(const PreemptionView& view, double waiting_share,
                                 const std::vector<size_t>& preempted) {
  using Order = std::tuple<bool, double, int, int64_t, int64_t>;
  std::optional<size_t> best;
  Order best_order{};
  for (size_t i = 0; i < view.started.size(); ++i) {
    const StartedJob& job = view.started[i];
    if (contains(preempted, i) || !may_be_preempted(job)) continue;
    const double share = view.share(job.tenant);
    const double margin = kPreemptMarginSeconds / view.weight(job.tenant);
    const bool has_several = kept_by(view, job.tenant, preempted) > 1;
    if (!has_several && share < waiting_share + margin) continue;
    const auto [priority, deadline_ms, seq] = least_urgent(job);
    const Order order(has_several, share, priority, deadline_ms, seq);
    if (best && order <= best_order) continue;
    best = i;
    best_order = order;
  }
  return best;
}

bool is_in_danger(const PreemptionView& view, const QueueHead& head) {
  if (head.deadline_ms == kNoDeadline) return false;
  const double left = static_cast<double>(head.deadline_ms - view.now_ms) / 1000.0;
  return left < kDeadlineReserve * view.expected_seconds(head.id) + kDeadlineReserveSeconds;
}

// The least urgent job of the same tenant that has to be preempted. None where the tenant's other
// jobs keep the head from its slot, which is then the last free one.
std::optional<size_t> own_victim(const PreemptionView& view, const QueueHead& head) {
  std::optional<size_t> best;
  const bool in_danger = is_in_danger(view, head);
  for (size_t i = 0; i < view.started.size(); ++i) {
    const StartedJob& job = view.started[i];
    if (job.tenant != head.tenant || !(job.is_asked || may_be_preempted(job))) continue;
    const bool stands_back =
        job.priority < head.priority ||
        (job.priority == head.priority && in_danger && job.deadline_ms > head.deadline_ms);
    if (!stands_back) continue;
    if (!best || least_urgent(view.started[*best]) < least_urgent(job)) best = i;
  }
  for (size_t i = 0; best && i < view.started.size(); ++i) {
    const StartedJob& other = view.started[i];
    if (i != *best && other.tenant == head.tenant && !is_more_urgent(head, other)) best.reset();
  }
  return best;
}

}  // namespace

bool is_left_out(const PreemptionView& view) {
  const auto stopping = std::ranges::count_if(view.started, [](const StartedJob& job) {
    const bool is_preempted_soon =
        job.is_preemptible && seconds_to_preemption(job) <= kPreemptedSoonSeconds;
    return is_preempted_soon || job.slot_seconds < kSoonSeconds;
  });
  return without_worker(view).size() > static_cast<size_t>(stopping);
}

bool may_be_preempted(const StartedJob& job) {
  return job.is_preemptible && seconds_to_preemption(job) <= 0;
}

std::vector<size_t> jobs_to_preempt(const PreemptionView& view) {
  const std::vector<const QueueHead*> waiting = without_worker(view);
  std::vector<size_t> preempted;
  for (size_t i = 0; i < view.started.size() && preempted.size() < waiting.size(); ++i) {
    if (view.started[i].is_asked && view.started[i].is_preemptible) preempted.push_back(i);
  }
  while (preempted.size() < waiting.size()) {
    const QueueHead& next = *waiting[preempted.size()];
    const auto victim = victim_for(view, view.share(next.tenant), preempted);
    if (!victim) break;
    preempted.push_back(*victim);
  }
  if (!waiting.empty()) return preempted;
  for (const QueueHead& head : view.heads) {
    if (const auto victim = own_victim(view, head)) return {*victim};
  }
  return preempted;
}

}  // namespace voxeld
