// The progress of running jobs, which changes too often for the database, and notifications of
// every change of a job.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/messages/job.h"
#include "server/base/thread_annotations.h"
#include "server/base/waker.h"
#include "server/jobs/model/job_watch.h"

namespace voxeld {

// Thread-safe.
class JobBoard {
 public:
  using Clock = std::chrono::steady_clock;
  using Now = std::function<Clock::time_point()>;

  explicit JobBoard(Now now = [] { return Clock::now(); }) : now_(std::move(now)) {}

  // A job was claimed: progress counts on from its version.
  void start(const std::string& id, int64_t version);
  // Takes a report. Changes nothing if it repeats what is known, or comes within the throttle of
  // the last change of the same stage.
  void progress(const std::string& id, std::string_view stage, int64_t tiles_done,
                int64_t tiles_total, int64_t frames_done = 0, int64_t frames_total = 0);
  // So many frames of the job are listed. Within the throttle it is announced by the next report.
  void frames_listed(const std::string& id, int64_t count);
  // More finished tiles of the job can be read. Announced as frames_listed().
  void tiles_kept(const std::string& id);
  // The highest version that anybody may have seen of a running job; 0 when it is not running.
  int64_t live_version(const std::string& id) const;
  // The job's stored state has changed; `running` is false when it ended or was put back. A change
  // that is told after the next claim does not end that one's progress.
  void changed(const std::string& id, int64_t version, bool running);
  // Adds progress to a status that was read from the database.
  void overlay(JobStatus& status) const;

  // Ask before running jobs: cancel() marks one, cancel_age() tells its worker's thread for how
  // long it has been marked (negative: not).
  void request_cancel(const std::string& id);
  double cancel_age_seconds(const std::string& id) const;

  // Wakes `waker` after changes of the job for as long as the result lives. It must not outlive the
  // board.
  std::unique_ptr<JobWatch> watch(std::string_view id, JobChange change,
                                  std::shared_ptr<Waker> waker);

 private:
  // At most about ten progress reports a second reach a job's watchers; fewer if there are more
  // than a hundred watchers, each of whom reads the database.
  static constexpr std::chrono::milliseconds kThrottle{100};
  static constexpr std::chrono::milliseconds kThrottlePerWatcher{1};

  struct Watcher {
    JobChange change;
    std::shared_ptr<Waker> waker;
  };
  using Watchers = std::list<Watcher>;
  using Wakers = std::vector<std::shared_ptr<Waker>>;
  class Watch;

  struct Entry {
    Watchers watchers;
    bool running = false;
    int64_t version = 0;
    std::string stage;
    int64_t tiles_done = 0, tiles_total = 0;
    bool has_tiles = false;  // this attempt has reported tiles
    int64_t frames_done = 0, frames_total = 0;
    bool is_untold = false;  // something changed within the throttle
    Clock::time_point changed_at{};
    Clock::time_point cancel_at{};
    bool cancel = false;

    Clock::duration throttle() const;
  };
  // Notes a change beside the reports: the wakers to call now; within the throttle there are none.
  Wakers note_change(Entry& entry) const;
  // The wakers to call, after mutex_ is released, for a change of that kind.
  static Wakers wakers_of(const Entry& entry, JobChange change);
  static void wake(const Wakers& wakers);
  void drop_if_idle(const std::string& id) REQUIRES(mutex_);

  const Now now_;
  mutable Mutex mutex_;
  std::map<std::string, std::unique_ptr<Entry>, std::less<>> entries_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
