#include "server/jobs/job_board.h"

#include <algorithm>
#include <utility>

namespace voxeld {

void JobBoard::start(const std::string& id, int64_t version) {
  MutexLock lock(mutex_);
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
  entry->changed.notify_all();
}

void JobBoard::progress(const std::string& id, std::string_view stage, int64_t tiles_done,
                        int64_t tiles_total, int64_t frames_done, int64_t frames_total) {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end() || !found->second->running) return;
  Entry& entry = *found->second;
  const bool same_stage = entry.stage == stage;
  const bool same = same_stage && entry.tiles_done == tiles_done &&
                    entry.tiles_total == tiles_total && entry.frames_done >= frames_done &&
                    entry.frames_total == frames_total;
  if (same && !entry.is_untold) return;
  const auto now = Clock::now();
  if (same_stage && now - entry.changed_at < kThrottle) return;
  entry.stage = stage;
  entry.tiles_done = tiles_done;
  entry.tiles_total = tiles_total;
  entry.has_tiles |= tiles_total > 0;
  entry.frames_done = std::max(entry.frames_done, frames_done);
  entry.frames_total = frames_total;
  entry.is_untold = false;
  entry.changed_at = now;
  ++entry.version;
  entry.changed.notify_all();
}

void JobBoard::frames_listed(const std::string& id, int64_t count) {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end() || !found->second->running) return;
  Entry& entry = *found->second;
  entry.frames_done = std::max(entry.frames_done, count);
  const auto now = Clock::now();
  entry.is_untold = now - entry.changed_at < kThrottle;
  if (entry.is_untold) return;
  entry.changed_at = now;
  ++entry.version;
  entry.changed.notify_all();
}

int64_t JobBoard::live_version(const std::string& id) const {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  return found == entries_.end() || !found->second->running ? 0 : found->second->version;
}

void JobBoard::changed(const std::string& id, int64_t version, bool running) {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end()) return;
  Entry& entry = *found->second;
  entry.version = std::max(entry.version, version);
  entry.running = running;
  entry.changed.notify_all();
  drop_if_idle(id);
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
  if (entry.has_tiles) {  // until it is where it was parked, that counts
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
  found->second->cancel_at = Clock::now();
}

double JobBoard::cancel_age_seconds(const std::string& id) const {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end() || !found->second->cancel) return -1.0;
  return std::chrono::duration<double>(Clock::now() - found->second->cancel_at).count();
}

void JobBoard::drop_if_idle(const std::string& id) {
  const auto found = entries_.find(id);
  if (found == entries_.end()) return;
  if (found->second->watchers == 0 && !found->second->running) entries_.erase(found);
}

JobBoard::Watch::Watch(JobBoard& board, std::string id) : board_(board), id_(std::move(id)) {
  MutexLock lock(board_.mutex_);
  auto& entry = board_.entries_[id_];
  if (entry == nullptr) entry = std::make_unique<Entry>();
  ++entry->watchers;
}

JobBoard::Watch::~Watch() {
  MutexLock lock(board_.mutex_);
  --board_.entries_[id_]->watchers;
  board_.drop_if_idle(id_);
}

void JobBoard::Watch::wait(int64_t after_version, Clock::time_point deadline) {
  MutexLock lock(board_.mutex_);
  Entry& entry = *board_.entries_[id_];
  while (entry.version <= after_version) {
    if (entry.changed.wait_until(lock, deadline) == std::cv_status::timeout) return;
  }
}

}  // namespace voxeld
