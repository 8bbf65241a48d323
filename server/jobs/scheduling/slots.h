// Which job a device takes, and which of its worker processes gets it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/jobs/records/job_queue.h"
#include "server/jobs/scheduling/worker_isolation.h"

namespace voxeld {

// A worker process of a device, as it waits for a task.
struct IdleSlot {
  int64_t connection = 0;
  int slot = 0;
  std::string tenant;            // of the task that it ran last; what it keeps is of this tenant
  std::vector<std::string> has;  // hashes of that task's input and of the grid that it made
  int64_t ended_at = 0;          // the number of that task among all that ended
  WorkerPast past = {};
};

// A task that a worker of the device runs or prepares.
struct StartedJob {
  std::string tenant;
  int priority = 0;
  int64_t deadline_ms = kNoDeadline;  // as JobRecord has it
  int64_t seq = 0;                    // order of arrival
  bool is_preemptible = false;        // as its worker says
  bool is_asked = false;              // to preempt
  double slot_seconds = 0;            // since it has its worker …
  double preparation_seconds = 0;     // … of which before its first step
  double device_seconds = 0;          // of all attempts
};

// Whether it is of higher priority or, at equal ones, of an earlier deadline.
bool is_more_urgent(const QueueHead& head, const StartedJob& job);

// The head of the tenant with the least device time; at equal shares the one that arrived first.
// The last free slot is reserved for tenants without started jobs on the device, unless the head is
// more urgent than all its tenant's started jobs. However many long jobs a tenant has, others find
// a worker.
std::optional<size_t> pick_head(const std::vector<QueueHead>& heads, size_t free_slots,
                                const std::vector<StartedJob>& started,
                                const std::function<double(const std::string&)>& share);

struct HeadChoice {
  std::optional<size_t> head;  // the one to claim, of which an idle worker may run the task
  // Heads before it that no idle worker may run. As many places are reserved for them until there
  // are fresh workers.
  int blocked = 0;
};

// Whether one of them may run the task.
bool can_run(const std::vector<IdleSlot>& idle, WorkerIsolation isolation, const QueueHead& head);

// The same under isolation: the order of tenants stays, and a tenant whose time slice it is loses
// it to others only where places are left.
HeadChoice pick_runnable_head(const std::vector<QueueHead>& heads,
                              const std::vector<IdleSlot>& idle, size_t free_slots,
                              const std::vector<StartedJob>& started, WorkerIsolation isolation,
                              const std::function<double(const std::string&)>& share);

// Connections of idle workers that are to be replaced by fresh ones, those first that have not had
// a task for longest: all that are used up, and as many more as are missing of `fresh_wanted`.
// `fresh_coming`: processes that start now.
std::vector<int64_t> workers_to_replace(std::vector<IdleSlot> idle, WorkerIsolation isolation,
                                        int fresh_wanted, int fresh_coming);

// The slot that has the input in its cache, else the one that worked for the tenant last, else that
// of the smallest number: without contention one process has all caches. At least one is idle.
size_t pick_slot(const std::vector<IdleSlot>& idle, std::string_view tenant,
                 std::string_view input);

}  // namespace voxeld
