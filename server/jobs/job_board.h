// What changes too often for the database, and who waits for it: the progress of running jobs, and
// the threads that wait for a job to change.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "proto/job.h"
#include "server/base/thread_annotations.h"

namespace voxeld {

// Thread-safe.
class JobBoard {
 public:
  using Clock = std::chrono::steady_clock;

  // A job was claimed: progress counts on from its version.
  void start(const std::string& id, int64_t version);
  // Takes a report. Changes nothing when it says what is known already, or within kThrottle of the
  // last change of the same stage.
  void progress(const std::string& id, std::string_view stage, int64_t tiles_done,
                int64_t tiles_total, int64_t frames_done = 0, int64_t frames_total = 0);
  // So many frames of the job are listed. Within kThrottle it is told with the next report.
  void frames_listed(const std::string& id, int64_t count);
  // The highest version that anybody may have seen of a running job; 0 when it is not running.
  int64_t live_version(const std::string& id) const;
  // The job's stored state has changed; `running` is false when it ended or was put back.
  void changed(const std::string& id, int64_t version, bool running);
  // Adds progress to a status that was read from the database.
  void overlay(JobStatus& status) const;

  // Ask before running jobs: cancel() marks one, cancel_age() tells its worker's thread for how
  // long it has been marked (negative: not).
  void request_cancel(const std::string& id);
  double cancel_age_seconds(const std::string& id) const;

  // Registers interest before the caller reads the status, so that no change falls between.
  class Watch {
   public:
    Watch(JobBoard& board, std::string id);
    ~Watch();
    Watch(const Watch&) = delete;
    Watch& operator=(const Watch&) = delete;
    // Blocks until a version above `after_version` was announced, or the deadline.
    void wait(int64_t after_version, Clock::time_point deadline);

   private:
    JobBoard& board_;
    const std::string id_;
  };

 private:
  // At most about ten changes a second reach those who watch.
  static constexpr std::chrono::milliseconds kThrottle{100};

  struct Entry {
    int watchers = 0;
    bool running = false;
    int64_t version = 0;
    std::string stage;
    int64_t tiles_done = 0, tiles_total = 0;
    bool has_tiles = false;  // this attempt has told of tiles
    int64_t frames_done = 0, frames_total = 0;
    bool is_untold = false;  // something changed within kThrottle
    Clock::time_point changed_at{};
    Clock::time_point cancel_at{};
    bool cancel = false;
    CondVar changed;
  };
  void drop_if_idle(const std::string& id) REQUIRES(mutex_);

  mutable Mutex mutex_;
  std::map<std::string, std::unique_ptr<Entry>, std::less<>> entries_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
