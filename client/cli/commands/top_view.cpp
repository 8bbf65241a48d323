#include "client/cli/commands/top_view.h"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <utility>

namespace voxeld::cli {
namespace {

using client::JobInfo;
using client::Queue;
using client::QueuedJob;

constexpr size_t kJobWidth = 12, kTenantWidth = 14, kKindWidth = 9;
constexpr int kRowsMin = 4;  // header, one device, header of the queue, and the count of omitted
                             // rows

// Names are untrusted, so only printable ASCII reaches the terminal.
std::string plain(std::string_view text) {
  std::string safe;
  for (const char c : text) safe += c >= 0x20 && c < 0x7f ? c : '?';
  return safe;
}

// The text cut or padded to exactly `width`.
std::string cell(std::string_view text, size_t width) {
  std::string fitted = plain(text).substr(0, width);
  if (text.size() > width && width > 1) fitted[width - 1] = '~';
  fitted.resize(width, ' ');
  return fitted;
}

std::string duration_text(int64_t ms) {
  const int64_t seconds = std::max<int64_t>(0, ms) / 1000;
  if (seconds < 100) return std::to_string(seconds) + "s";
  constexpr int64_t kMinute = 60, kHour = 60 * kMinute, kDay = 24 * kHour;
  if (seconds < 100 * kMinute) return std::to_string(seconds / kMinute) + "m";
  if (seconds < 100 * kHour) return std::to_string(seconds / kHour) + "h";
  return std::to_string(seconds / kDay) + "d";
}

std::string clock_text(int64_t now_ms) {
  const std::time_t now = now_ms / 1000;
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  char text[16];
  std::strftime(text, sizeof text, "%H:%M:%SZ", &utc);
  return text;
}

std::string tenant_text(const std::string& tenant) {
  return tenant.empty() ? "-" : tenant;
}

// The count of frames if there are several, else of tiles.
std::pair<int64_t, int64_t> counts_of(const JobInfo& job) {
  if (job.frames_total > 1) return {job.frames_done, job.frames_total};
  return {job.tiles_done, job.tiles_total};
}

std::string job_cells(const QueuedJob& one) {
  return cell(one.job.id, kJobWidth) + " " + cell(tenant_text(one.tenant), kTenantWidth) + " " +
         cell(one.job.kind, kKindWidth);
}

// The progress of a queued job that was preempted; empty for a job that has not started.
std::string preempted_text(const JobInfo& job) {
  const auto [done, total] = counts_of(job);
  if (done == 0 || total == 0) return "";
  return " preempted at " + std::to_string(done) + "/" + std::to_string(total);
}

std::string queue_line(const QueuedJob& one, int64_t now_ms) {
  char position[8];
  std::snprintf(position, sizeof position, "%5lld ",
                static_cast<long long>(one.job.queue_position));
  return position + job_cells(one) + " " + cell(one.job.state, 8) + " " +
         duration_text(now_ms - one.created_ms) + preempted_text(one.job);
}

}  // namespace

void TopView::follow(const Queue& queue, Clock::time_point at) {
  std::map<std::string, Seen> now;
  for (const QueuedJob& one : queue.jobs) {
    if (one.job.state != "running") continue;
    Seen seen{one.job.stage, counts_of(one.job).first, at, -1};
    const auto before = seen_.find(one.job.id);
    if (before != seen_.end() && before->second.stage == seen.stage) {
      const double seconds = std::chrono::duration<double>(at - before->second.at).count();
      const int64_t more = seen.done - before->second.done;
      seen.per_second = before->second.per_second;
      if (more >= 0 && seconds > 0) seen.per_second = static_cast<double>(more) / seconds;
    }
    now.emplace(one.job.id, std::move(seen));
  }
  seen_ = std::move(now);
}

std::string TopView::progress_of(const JobInfo& job) const {
  const auto [done, total] = counts_of(job);
  std::string text = cell(job.stage.empty() ? "-" : job.stage, 9);
  if (total == 0) return text;
  text += " " + std::to_string(done) + "/" + std::to_string(total) +
          (job.frames_total > 1 ? " frames" : " tiles");
  const auto seen = seen_.find(job.id);
  if (seen != seen_.end() && seen->second.per_second >= 0) {
    char rate[32];
    std::snprintf(rate, sizeof rate, " %.1f/s", seen->second.per_second);
    text += rate;
  }
  return text;
}

void TopView::add_devices(const Queue& queue, int64_t now_ms,
                          std::vector<std::string>& lines) const {
  lines.push_back("DEVICE       BUSY  RENDERER");
  for (const client::QueueDevice& device : queue.devices) {
    const std::string busy = device.workers == 0 ? "down"
                                                 : std::to_string(device.workers_busy) + "/" +
                                                       std::to_string(device.workers);
    lines.push_back(cell(device.device, 12) + " " + cell(busy, 5) + " " + plain(device.renderer));
    int64_t shown = 0;
    for (const QueuedJob& one : queue.jobs) {
      if (std::ranges::find(device.jobs, one.job.id) == device.jobs.end()) continue;
      lines.push_back("  " + job_cells(one) + " " +
                      cell(duration_text(now_ms - one.started_ms), 4) + " " + progress_of(one.job));
      ++shown;
    }
    const int64_t hidden = device.workers_busy - shown;
    if (hidden > 0) lines.push_back("  " + std::to_string(hidden) + " of others");
  }
}

std::vector<std::string> TopView::lines(const Queue& queue, ScreenSize size, int64_t now_ms,
                                        Clock::time_point at) {
  follow(queue, at);
  std::string head = "voxel top  " + plain(url_) + "  " + clock_text(now_ms) + "  running " +
                     std::to_string(queue.running) + "  queued " + std::to_string(queue.queued);
  if (queue.others_queued > 0) {
    head += " (" + std::to_string(queue.others_queued) + " of others)";
  }
  std::vector<std::string> lines = {head, ""};
  add_devices(queue, now_ms, lines);
  lines.emplace_back();
  lines.push_back("  POS " + cell("JOB", kJobWidth) + " " + cell("TENANT", kTenantWidth) + " " +
                  cell("KIND", kKindWidth) + " STATE    AGE");
  for (const QueuedJob& one : queue.jobs) {
    if (one.job.state == "queued") lines.push_back(queue_line(one, now_ms));
  }
  const auto rows = static_cast<size_t>(std::max(kRowsMin, size.rows));
  if (lines.size() > rows) {
    const size_t left_out = lines.size() - rows + 1;
    lines.resize(rows - 1);
    lines.push_back("  ... " + std::to_string(left_out) + " more lines");
  }
  for (std::string& line : lines) line = line.substr(0, static_cast<size_t>(size.columns));
  return lines;
}

}  // namespace voxeld::cli
