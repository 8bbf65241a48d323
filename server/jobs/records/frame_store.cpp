#include "server/jobs/records/frame_store.h"

#include <array>
#include <charconv>
#include <memory>
#include <semaphore>
#include <utility>

#include "server/base/disk/file.h"
#include "server/jobs/model/results.h"
#include "server/jobs/records/blob_needs.h"
#include "server/jobs/records/quota.h"
#include "server/jobs/records/visibility.h"

namespace voxeld {
namespace {

constexpr int kManifestsMax = 4;  // that are parsed at a time

// The shortest text that reads back as the same number.
std::string time_text(double time_s) {
  std::array<char, 32> buffer{};
  const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), time_s);
  return {buffer.data(), end};
}

double time_of(const std::string& text) {
  double value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

// The tenant of the job, while it runs under this fence.
Result<std::optional<std::string>> current_tenant(SqlConnection& connection,
                                                  const TaskFrame& frame) {
  VOXELD_ASSIGN(
      SqlStatement found,
      connection.query("SELECT tenant FROM jobs WHERE id = $1 AND fence = $2 AND state = 'running'",
                       frame.task, frame.fence));
  VOXELD_ASSIGN(const bool row, found.step());
  return row ? std::optional(found.text(0)) : std::nullopt;
}

Status insert_frame(SqlConnection& connection, const TaskFrame& frame, const BlobInfo& grid,
                    std::string_view tenant) {
  return connection.run(
      "INSERT INTO frames (job_id, frame, time_s, grid, voxel_count, content_hash, tenant, bytes)"
      " VALUES ($1, $2, $3, $4, $5, $6, $7, $8) ON CONFLICT (job_id, frame) DO UPDATE SET"
      " time_s = excluded.time_s, grid = excluded.grid, voxel_count = excluded.voxel_count,"
      " content_hash = excluded.content_hash, bytes = excluded.bytes,"
      " expired_ms = 0",
      frame.task, frame.index, time_text(frame.time_s), grid.id,
      static_cast<int64_t>(frame.voxel_count), frame.content_hash, tenant, grid.bytes);
}

// Empty if the job has not listed it.
Result<std::string> grid_of(SqlConnection& connection, std::string_view job, int64_t index) {
  VOXELD_ASSIGN(
      SqlStatement found,
      connection.query("SELECT grid FROM frames WHERE job_id = $1 AND frame = $2", job, index));
  VOXELD_ASSIGN(const bool row, found.step());
  return row ? found.text(0) : std::string();
}

Result<int64_t> count_frames(SqlConnection& connection, std::string_view job) {
  VOXELD_ASSIGN(SqlStatement count,
                connection.query("SELECT COUNT(*) FROM frames WHERE job_id = $1", job));
  VOXELD_TRY(count.step());
  return count.int64(0);
}

}  // namespace

Result<std::optional<int64_t>> FrameStore::add(const TaskFrame& frame, const BlobInfo& grid,
                                               int64_t frames_total, int64_t bytes_max,
                                               std::string* replaced) {
  std::optional<int64_t> listed;
  std::string earlier;
  Status committed = database_.write([&](SqlConnection& connection) -> Status {
    VOXELD_ASSIGN(const auto tenant, current_tenant(connection, frame));
    if (!tenant) return {};
    VOXELD_ASSIGN(const int64_t used, used_bytes(connection, *tenant));
    VOXELD_ASSIGN(earlier, grid_of(connection, frame.task, frame.index));
    VOXELD_TRY(insert_frame(connection, frame, grid, *tenant));
    VOXELD_TRY(check_growth(connection, *tenant, used, bytes_max));
    if (frames_total > 0) {
      VOXELD_TRY(connection.run("UPDATE jobs SET frames_total = $2 WHERE id = $1", frame.task,
                                frames_total));
    }
    VOXELD_ASSIGN(listed, count_frames(connection, frame.task));
    return {};
  });
  VOXELD_TRY(committed);
  if (replaced != nullptr && earlier != grid.id) *replaced = std::move(earlier);
  return listed;
}

Result<std::vector<ListedFrame>> FrameStore::of_job(std::string_view job, const FrameRange& range) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  VOXELD_ASSIGN(SqlStatement rows,
                reader->query("SELECT frame, time_s, grid, voxel_count, content_hash FROM frames"
                              " WHERE job_id = $1 AND frame >= $2 ORDER BY frame LIMIT $3",
                              job, range.first, range.count));
  std::vector<ListedFrame> frames;
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) return frames;
    frames.push_back({rows.int64(0),
                      {time_of(rows.text(1)), rows.text(2), static_cast<uint64_t>(rows.int64(3)),
                       rows.text(4)}});
  }
}

Result<SequenceManifest> FrameStore::read(const Caller& caller, std::string_view sequence) {
  {
    VOXELD_ASSIGN(Database::Lease reader, database_.read());
    VOXELD_TRY(check_stored_sequence(*reader, caller, sequence));
  }
  VOXELD_TRY(named_blob(blobs_, sequence, "the sequence " + std::string(sequence),
                        "submit the job that made it again"));
  return read_blob(sequence);
}

Result<SequenceManifest> FrameStore::read_blob(std::string_view id) {
  // A manifest of 4096 frames takes 8 MB while it is parsed: a few callers at a time.
  static std::counting_semaphore<kManifestsMax> places(kManifestsMax);
  places.acquire();
  const auto leave = [](std::counting_semaphore<kManifestsMax>* taken) { taken->release(); };
  const std::unique_ptr<std::counting_semaphore<kManifestsMax>, decltype(leave)> place(&places,
                                                                                       leave);
  VOXELD_ASSIGN(const std::vector<uint8_t> bytes, voxeld::read_blob(blobs_, id));
  return parse_sequence({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

Result<SequenceSize> FrameStore::size_of(std::string_view sequence) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  VOXELD_ASSIGN(SqlStatement found,
                reader->query("SELECT r.frames, (SELECT COALESCE(SUM(f.bytes), 0) FROM frames f"
                              " WHERE f.job_id = r.job_id) FROM results r WHERE r.sequence = $1"
                              " AND r.sequence <> '' ORDER BY r.seq DESC LIMIT 1",
                              sequence));
  VOXELD_ASSIGN(const bool row, found.step());
  return row ? SequenceSize{found.int64(0), found.int64(1)} : SequenceSize{};
}

Result<int64_t> FrameStore::check(std::string_view job, std::string_view sequence) {
  const auto wrong = [](std::string detail, std::string expected, std::string got) {
    return Error{ErrorCode::kInternal, "worker brings a sequence: " + std::move(detail),
                 std::move(expected), std::move(got)};
  };
  auto manifest = read_blob(sequence);
  if (!manifest) return wrong(manifest.error().message(), "", "");
  VOXELD_ASSIGN(const std::vector<ListedFrame> listed, of_job(job));
  const std::vector<SequenceFrame>& named = manifest->frames;
  if (named.size() != listed.size()) {
    return wrong("number of frames", std::to_string(listed.size()), std::to_string(named.size()));
  }
  for (size_t i = 0; i < named.size(); ++i) {
    if (listed[i].index == static_cast<int64_t>(i) && listed[i].frame.grid == named[i].grid) {
      continue;
    }
    return wrong("grid of frame " + std::to_string(i), listed[i].frame.grid, named[i].grid);
  }
  return static_cast<int64_t>(named.size());
}

}  // namespace voxeld
