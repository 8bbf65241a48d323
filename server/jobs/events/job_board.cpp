#include "server/jobs/events/job_board.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace voxeld {

// One watcher of a job.
class JobBoard::Watch final : public JobWatch {
 public:
  Watch(JobBoard& board, std::string id, Watchers::iterator watcher)
      : board_(board), id_(std::move(id)), watcher_(watcher) {}
  ~Watch() override {
    std::shared_ptr<Waker> waker;  // is destroyed after the lock is released
    const MutexLock lock(board_.mutex_);
    waker = std::move(watcher_->waker);
    board_.entries_.find(id_)->second->watchers.erase(watcher_);
    board_.drop_if_idle(id_);
  }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

 private:
  JobBoard& board_;
  const std::string id_;
  const Watchers::iterator watcher_;
};

void JobBoard::wake(const Wakers& wakers) {
  for (const auto& waker : wakers) waker->wake();
}

JobBoard::Clock::duration JobBoard::Entry::throttle() const {
  return std::max(kThrottle, kThrottlePerWatcher * static_cast<int64_t>(watchers.size()));
}

JobBoard::Wakers JobBoard::wakers_of(const Entry& entry, JobChange change) {
  Wakers wakers;
  for (const Watcher& watcher : entry.watchers) {
    if (change == JobChange::kState || watcher.change == JobChange::kAny) {
      wakers.push_back(watcher.waker);
    }
  }
  return wakers;
}

void JobBoard::start(const std::string& id, int64_t version) {
  Wakers wakers;
  {
    const MutexLock lock(mutex_);
    auto& entry = entries_[id];
    if (entry == nullptr) entry = std::make_unique<Entry>();
    entry->running = true;
    entry->version = std::max(entry->version, version);
    entry->stage.clear();
    entry->tiles_done = entry->tiles_total = 0;
    entry->has_tiles = false;
    entry->frames_done = entry->frames_total = 0;
    entry->is_untold = false;
    entry->changed_at = {};
    entry->cancel = false;
    wakers = wakers_of(*entry, JobChange::kAny);
  }
  wake(wakers);
}

void JobBoard::progress(const std::string& id, std::string_view stage, int64_t tiles_done,
                        int64_t tiles_total, int64_t frames_done, int64_t frames_total) {
  Wakers wakers;
  {
    const MutexLock lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end() || !found->second->running) return;
    Entry& entry = *found->second;
    const bool same_stage = entry.stage == stage;
    const bool same = same_stage && entry.tiles_done == tiles_done &&
                      entry.tiles_total == tiles_total && entry.frames_done >= frames_done &&
                      entry.frames_total == frames_total;
    if (same && !entry.is_untold) return;
    const auto now = now_();
    if (same_stage && now - entry.changed_at < entry.throttle()) return;
    entry.stage = stage;
    entry.tiles_done = tiles_done;
    entry.tiles_total = tiles_total;
    entry.has_tiles |= tiles_total > 0;
    entry.frames_done = std::max(entry.frames_done, frames_done);
    entry.frames_total = frames_total;
    entry.is_untold = false;
    entry.changed_at = now;
    ++entry.version;
    wakers = wakers_of(entry, JobChange::kAny);
  }
  wake(wakers);
}

void JobBoard::frames_listed(const std::string& id, int64_t count) {
  Wakers wakers;
  {
    const MutexLock lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end() || !found->second->running) return;
    Entry& entry = *found->second;
    entry.frames_done = std::max(entry.frames_done, count);
    wakers = note_change(entry);
  }
  wake(wakers);
}

void JobBoard::tiles_kept(const std::string& id) {
  Wakers wakers;
  {
    const MutexLock lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end() || !found->second->running) return;
    wakers = note_change(*found->second);
  }
  wake(wakers);
}

JobBoard::Wakers JobBoard::note_change(Entry& entry) const {
  const auto now = now_();
  entry.is_untold = now - entry.changed_at < entry.throttle();
  if (entry.is_untold) return {};
  entry.changed_at = now;
  ++entry.version;
  return wakers_of(entry, JobChange::kAny);
}

int64_t JobBoard::live_version(const std::string& id) const {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  return found == entries_.end() || !found->second->running ? 0 : found->second->version;
}

void JobBoard::changed(const std::string& id, int64_t version, bool running) {
  Wakers wakers;
  {
    const MutexLock lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end()) return;
    Entry& entry = *found->second;
    // A job that was put back may run again before this is told of it.
    if (version >= entry.version) entry.running = running;
    entry.version = std::max(entry.version, version);
    wakers = wakers_of(entry, JobChange::kState);
    drop_if_idle(id);
  }
  wake(wakers);
}

void JobBoard::overlay(JobStatus& status) const {
  if (status.state != JobState::kRunning) return;
  MutexLock lock(mutex_);
  const auto found = entries_.find(status.id);
  if (found == entries_.end() || !found->second->running) return;
  const Entry& entry = *found->second;
  if (entry.version < status.version) return;
  status.version = entry.version;
  status.stage = entry.stage;
  if (entry.has_tiles) {  // until it is where it was preempted, that counts
    status.tiles_done = entry.tiles_done;
    status.tiles_total = entry.tiles_total;
  }
  status.frames_done = std::max(status.frames_done, entry.frames_done);
  status.frames_total = std::max(status.frames_total, entry.frames_total);
}

void JobBoard::request_cancel(const std::string& id) {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end() || found->second->cancel) return;
  found->second->cancel = true;
  found->second->cancel_at = now_();
}

double JobBoard::cancel_age_seconds(const std::string& id) const {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end() || !found->second->cancel) return -1.0;
  return std::chrono::duration<double>(now_() - found->second->cancel_at).count();
}

void JobBoard::drop_if_idle(const std::string& id) {
  const auto found = entries_.find(id);
  if (found == entries_.end()) return;
  if (found->second->watchers.empty() && !found->second->running) entries_.erase(found);
}

std::unique_ptr<JobWatch> JobBoard::watch(std::string_view id, JobChange change,
                                          std::shared_ptr<Waker> waker) {
  std::string name(id);
  const MutexLock lock(mutex_);
  auto& entry = entries_[name];
  if (entry == nullptr) entry = std::make_unique<Entry>();
  Watchers& watchers = entry->watchers;
  watchers.push_back({change, std::move(waker)});
  return std::make_unique<Watch>(*this, std::move(name), std::prev(watchers.end()));
}

}  // namespace voxeld
