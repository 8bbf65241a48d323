// Settings of the task server, and the parts of the service that worker sessions, the dispatcher
// and the adoption of outputs work on.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "server/jobs/events/job_board.h"
#include "server/jobs/events/job_metrics.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/model/tenant_limits.h"
#include "server/jobs/model/worker_state.h"
#include "server/jobs/records/asset_store.h"
#include "server/jobs/records/frame_store.h"
#include "server/jobs/records/job_store.h"
#include "server/jobs/scheduling/time_slices.h"
#include "server/jobs/scheduling/worker_isolation.h"
#include "server/store/disk_room.h"
#include "server/store/object_store.h"
#include "server/store/part_store.h"

namespace voxeld {

// Workers of a device that are added one by one where tasks that cannot be preempted have all
// others and a tenant waits without one.
inline constexpr int kExtraWorkersMax = 4;

struct TaskServerConfig {
  std::filesystem::path socket;        // DIR/run/tasks.sock
  std::filesystem::path scratch_root;  // a folder per connection is made here
  // How the process ended ("signal 9 (Killed)"), waiting a moment for it; empty: unknown.
  std::function<std::string(int64_t pid)> exit_reason;
  std::function<void(int64_t pid)> kill_worker;
  // Ends an idle worker; another one starts in its place. null: its connection closes, no more.
  // Called with the dispatcher locked, so it must not call it.
  std::function<void(int64_t pid)> replace_worker;
  std::function<WorkerIsolation()> isolation;  // asked before each claim; null: kNone
  // Tasks of a device that run at a time, where it has more processes: `reserve` tells by how many.
  int workers_per_device = 1;
  std::function<int()> reserve;  // null: 0
  // Runs so many more processes of a device, at most kExtraWorkersMax; null: never.
  std::function<void(const std::string& device, int workers)> set_extra;
  std::function<int(int64_t pid)> slot_of;  // among the device's processes; null: 0
  // A worker that has opened its device is there.
  std::function<void(const std::string& device)> on_connected;
  std::function<void(int64_t pid)> on_task;  // before a worker gets one; null: nobody
  bool is_fair = true;                       // false: jobs are claimed as they arrived
  // That a queued job will take, as it is estimated; 0: not known. null: never known.
  std::function<double(const std::string& job)> expected_seconds;
  TaskLimits limits;
  std::function<TenantLimits(std::string_view tenant)> limits_of;  // null: none
};

// The parts of the service that tasks work on; all of them outlive the server.
struct TaskServerContext {
  JobStore& jobs;
  AssetStore& assets;
  FrameStore& frames;
  ObjectStore& blobs;
  DiskRoom& disk;  // of the daemon's data: database, blobs, scratch
  PartStore& parts;
  JobBoard& board;
  JobMetrics& metrics;
  TimeSlices& slices;
  std::function<void(const JobRecord&)> job_changed;  // after each durable change; never throws

  // Facts of a running task that are not in the database yet.
  LiveJob live(const std::string& task) const {
    return {board.live_version(task), slices.device_us(task)};
  }
};

}  // namespace voxeld
