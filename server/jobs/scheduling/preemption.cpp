#include "server/jobs/scheduling/preemption.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <tuple>

namespace voxeld {
namespace {

bool contains(const std::vector<size_t>& list, size_t index) {
  return std::find(list.begin(), list.end(), index) != list.end();
}

// Greater ones are parked first, of one tenant's jobs.
auto least_urgent(const StartedJob& job) {
  return std::tuple(-job.priority, job.deadline_ms, job.seq);
}

// How many workers a tenant keeps beside those that are to be parked.
size_t kept_by(const ParkingView& view, const std::string& tenant,
               const std::vector<size_t>& parked) {
  size_t count = 0;
  for (size_t i = 0; i < view.started.size(); ++i) {
    count += view.started[i].tenant == tenant && !contains(parked, i) ? 1u : 0u;
  }
  return count;
}

std::vector<const QueueHead*> without_worker(const ParkingView& view) {
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
std::optional<size_t> victim_for(const ParkingView& view, double waiting_share,
                                 const std::vector<size_t>& parked) {
  using Order = std::tuple<bool, double, int, int64_t, int64_t>;
  std::optional<size_t> best;
  Order best_order{};
  for (size_t i = 0; i < view.started.size(); ++i) {
    const StartedJob& job = view.started[i];
    if (contains(parked, i) || !may_be_parked(job)) continue;
    const double share = view.share(job.tenant);
    const double margin = kParkMarginSeconds / view.weight(job.tenant);
    const bool has_several = kept_by(view, job.tenant, parked) > 1;
    if (!has_several && share < waiting_share + margin) continue;
    const auto [priority, deadline_ms, seq] = least_urgent(job);
    const Order order(has_several, share, priority, deadline_ms, seq);
    if (best && order <= best_order) continue;
    best = i;
    best_order = order;
  }
  return best;
}

bool is_in_danger(const ParkingView& view, const QueueHead& head) {
  if (head.deadline_ms == kNoDeadline) return false;
  const double left = static_cast<double>(head.deadline_ms - view.now_ms) / 1000.0;
  return left < kDeadlineReserve * view.expected_seconds(head.id) + kDeadlineReserveSeconds;
}

// The least urgent job of the same tenant that has to be preempted.
std::optional<size_t> own_victim(const ParkingView& view, const QueueHead& head) {
  std::optional<size_t> best;
  const bool in_danger = is_in_danger(view, head);
  for (size_t i = 0; i < view.started.size(); ++i) {
    const StartedJob& job = view.started[i];
    if (job.tenant != head.tenant || !(job.is_asked || may_be_parked(job))) continue;
    const bool stands_back =
        job.priority < head.priority ||
        (job.priority == head.priority && in_danger && job.deadline_ms > head.deadline_ms);
    if (!stands_back) continue;
    if (!best || least_urgent(view.started[*best]) < least_urgent(job)) best = i;
  }
  return best;
}

}  // namespace

bool may_be_parked(const StartedJob& job) {
  if (!job.can_park) return false;
  const double worked = job.slot_seconds - job.preparation_seconds;
  const double quantum = std::clamp(kParkQuantumShare * job.device_seconds, kParkQuantumSecondsMin,
                                    kParkQuantumSecondsMax);
  return worked >= std::max(quantum, kParkPreparations * job.preparation_seconds);
}

std::vector<size_t> jobs_to_park(const ParkingView& view) {
  const std::vector<const QueueHead*> waiting = without_worker(view);
  std::vector<size_t> parked;
  for (size_t i = 0; i < view.started.size() && parked.size() < waiting.size(); ++i) {
    if (view.started[i].is_asked && view.started[i].can_park) parked.push_back(i);
  }
  while (parked.size() < waiting.size()) {
    const QueueHead& next = *waiting[parked.size()];
    const auto victim = victim_for(view, view.share(next.tenant), parked);
    if (!victim) break;
    parked.push_back(*victim);
  }
  if (!waiting.empty()) return parked;
  for (const QueueHead& head : view.heads) {
    if (const auto victim = own_victim(view, head)) return {*victim};
  }
  return parked;
}

}  // namespace voxeld
