// The worker processes and the queue, as they are shown, and the limits of a worker.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "proto/messages/job.h"
#include "proto/messages/task_api.h"

namespace voxeld {

struct WorkerState {
  std::string device, renderer, driver;
  int slot = 0;  // among the processes of the device
  int64_t pid = 0;
  bool connected = false;
  int64_t restarts = 0;
  std::string task;        // job id it runs, or empty
  std::string last_error;  // of a device that cannot be opened
  // The error of the last job that used the device, in whose place the CPU went on; empty: the
  // device works.
  std::string device_failure;
  std::string device_json;
  std::string sandbox;       // "full", "off", or what is missing
  int64_t memory_bytes = 0;  // that its process takes; 0: not looked at yet
  DeviceMemory device_memory;
};

// A job of a list, in brief.
struct ListedJob {
  int64_t seq = 0;  // order of arrival
  std::string tenant;
  std::string device;  // that runs it, or empty
  JobStatus status;
};

// The queue as one caller may see it, without its jobs.
struct QueueView {
  struct Device {
    std::string device, renderer;
    int64_t workers = 0;  // that are connected
    int64_t workers_busy = 0;
    int64_t memory_bytes = 0;       // that its workers take
    std::vector<std::string> jobs;  // those of the caller that run on it
  };
  struct Store {
    int64_t bytes = 0;  // of stored files
    int64_t disk_free_bytes = 0, disk_bytes = 0;
  };
  std::vector<Device> devices;
  // Set for an admin, and if there is one tenant: memory and storage reveal what others do.
  std::optional<Store> store;
  int64_t queued = 0, running = 0;                // of all tenants
  int64_t others_queued = 0, others_running = 0;  // of tenants that the caller does not see
};

// When a worker that runs a task is taken for lost, and killed if it is ours. Seconds.
struct TaskLimits {
  // Workers report at least every 200 ms; one that is silent for so long is stopped or stuck.
  double silence_seconds_max = 30.0;
  // Duration of one message, from its first byte until the worker has taken the reply.
  double message_seconds_max = 10.0;
  // A worker with a time slice that is silent for so long loses it: others have the device.
  double slice_silence_seconds_max = 2.0;
  // A cancel takes effect within a tile, or the worker ends.
  double cancel_seconds_max = 10.0;
  // It reports, but says the same each time: a shader or a parser that never ends.
  double stall_seconds_max = 600.0;
  // Duration of one attempt: deadline-exceeded.
  double job_seconds_max = 86'400.0;
  // Memory of one worker process: grid-too-large. 0: no limit.
  int64_t worker_memory_bytes_max = 0;
  // Memory of all worker processes together: the one that takes the most beyond what its task was
  // granted ends, and its job is put back. 0: no limit.
  int64_t all_workers_memory_bytes_max = 0;
  // Bytes that one worker has written for its task: storage-full. 0: a quarter of the disk.
  int64_t scratch_bytes_max = 0;
  // Messages of a worker's connection: in the long run, and at once. A worker reports five times a
  // second, asks for the device up to 20 times a second, and hands over the frames and images of an
  // animation as fast as it makes them. One that says more keeps the gateway busy: it ends.
  double messages_per_second_max = 2000;
  double messages_at_once_max = 10'000;
};

}  // namespace voxeld
