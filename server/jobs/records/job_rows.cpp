#include "server/jobs/records/job_rows.h"

#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "proto/messages/job_text.h"
#include "proto/text/client_texts.h"
#include "server/jobs/records/job_queue.h"
#include "server/jobs/records/quota.h"

namespace voxeld {
namespace {

using nlohmann::json;

// A column, of which a brief reading takes no long text.
std::string whole_column(std::string_view name, JobTexts texts) {
  if (texts == JobTexts::kWhole) return std::string(name);
  // By characters, as PostgreSQL counts too. is_brief() tells what is empty for that.
  return "CASE WHEN LENGTH(" + std::string(name) +
         ") <= " + std::to_string(limits::kRowTextBytesMax) + " THEN " + std::string(name) +
         " ELSE '' END";
}
// The same of a text that means something when it is cut.
std::string cut_column(std::string_view name, JobTexts texts) {
  if (texts == JobTexts::kWhole) return std::string(name);
  return "SUBSTR(" + std::string(name) + ", 1, " + std::to_string(limits::kRowTextBytesMax) + ")";
}

// In the order in which read_record takes them.
std::string select_text(JobTexts texts) {
  const auto whole = [&](std::string_view name) { return whole_column(name, texts); };
  const auto cut = [&](std::string_view name) { return cut_column(name, texts); };
  return "SELECT j.tenant, j.asset_tenant, j.seq, j.id, j.kind, j.state, j.asset, j.grid, " +
         cut("j.filename") + ", " + whole("j.options_json") +
         ", j.request_hash, j.use_cache, j.transient, j.cached, j.cancel_requested, j.version,"
         " j.attempt, j.fence, j.worker, " +
         cut("j.lost_workers") +
         ", j.displaced_bytes, j.upload_us, j.created_ms, j.started_ms,"
         " j.ended_ms, j.priority, j.deadline_ms, j.device_us, j.preempted, j.queued_ms,"
         " j.tiles_done, j.tiles_total, j.sequence, j.frames_total, j.deadline_at_ms,"
         " (SELECT COUNT(*) FROM frames f WHERE f.job_id = j.id), " +
         whole("j.timings_json") + ", j.error_code, " + cut("j.error_detail") + ", " +
         cut("j.error_expected") + ", " + cut("j.error_got") +
         ", j.request_id, j.trace_id, j.result_seq, r.blob, r.bytes, r.media_type, " +
         cut("r.filename") + ", r.grid, " + whole("r.meta_json") + ", " + whole("r.warnings_json") +
         ", r.sequence, r.frames, r.expired_ms FROM jobs j LEFT JOIN results r ON r.seq = "
         "j.result_seq";
}
const std::string& select_of(JobTexts texts) {
  static const std::string whole = select_text(JobTexts::kWhole);
  static const std::string brief = select_text(JobTexts::kBrief);
  return texts == JobTexts::kWhole ? whole : brief;
}

// Reads columns from left to right.
class ColumnReader {
 public:
  explicit ColumnReader(const SqlStatement& statement) : statement_(statement) {}
  int64_t int64() { return statement_.int64(next_++); }
  std::string text() { return statement_.text(next_++); }

 private:
  const SqlStatement& statement_;
  int next_ = 0;
};

// The database wrote these texts itself; what it cannot read back is left out.
StageTimes parse_timings(const std::string& text) {
  StageTimes timings;
  const json list = json::parse(text, nullptr, false);
  if (!list.is_array()) return timings;
  for (const json& item : list) {
    if (item.is_array() && item.size() == 2 && item[0].is_string() && item[1].is_number()) {
      timings.emplace_back(item[0].get<std::string>(), item[1].get<double>());
    }
  }
  return timings;
}

std::vector<Warning> parse_warnings(const std::string& text) {
  std::vector<Warning> warnings;
  if (text.empty()) return {warnings_left_out()};
  const json list = json::parse(text, nullptr, false);
  if (!list.is_array()) return warnings;
  for (const json& item : list) {
    if (item.is_array() && item.size() == 2 && item[0].is_string() && item[1].is_string()) {
      warnings.push_back({item[0].get<std::string>(), item[1].get<std::string>()});
    }
  }
  return warnings;
}

std::string dump(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

// A cached result was named after another upload of the same bytes: the stem is this job's.
std::string name_of_cached(const std::string& job_filename, const std::string& result_filename) {
  if (job_filename.empty()) return result_filename;
  const std::string extension = std::filesystem::path(result_filename).extension().string();
  return std::filesystem::path(job_filename).stem().string() + extension;
}

JobRecord read_record(const SqlStatement& statement) {
  ColumnReader column(statement);
  JobRecord record;
  JobStatus& status = record.status;
  record.tenant = column.text();
  record.asset_tenant = column.text();
  record.seq = column.int64();
  status.id = column.text();
  status.kind = job_kind_from_name(column.text()).value_or(JobKind::kVoxelize);
  status.state = job_state_from_name(column.text()).value_or(JobState::kFailed);
  status.asset = column.text();
  status.grid = column.text();
  status.filename = column.text();
  status.options_json = column.text();
  record.request_hash = column.text();
  record.use_cache = column.int64() != 0;
  record.transient = column.int64() != 0;
  status.cached = column.int64() != 0;
  record.cancel_requested = column.int64() != 0;
  status.version = column.int64();
  status.attempt = static_cast<int>(column.int64());
  record.fence = column.int64();
  record.worker = column.text();
  record.lost_workers = column.text();
  record.displaced_bytes = column.int64();
  record.upload_ms = static_cast<double>(column.int64()) / 1000.0;
  status.created_ms = column.int64();
  status.started_ms = column.int64();
  status.ended_ms = column.int64();
  status.priority = static_cast<int>(column.int64());
  record.deadline_ms = column.int64();
  status.device_ms = static_cast<double>(column.int64()) / 1000.0;
  status.preempted = static_cast<int>(column.int64());
  record.queued_ms = column.int64();
  if (record.queued_ms == 0) record.queued_ms = status.created_ms;
  const int64_t tiles_done = column.int64(), tiles_total = column.int64();
  if (!status.ended()) {
    status.tiles_done = tiles_done;
    status.tiles_total = tiles_total;
  }
  status.sequence = column.text();
  status.frames_total = column.int64();
  status.deadline_at_ms = column.int64();
  status.frames_done = column.int64();
  status.timings = parse_timings(column.text());
  Error error;
  const std::string error_name = column.text();
  error.detail = column.text();
  error.expected = column.text();
  error.got = column.text();
  if (!error_name.empty()) {
    error.code = error_code_from_name(error_name);
    status.error = std::move(error);
  }
  record.request_id = column.text();
  record.trace_id = column.text();
  if (column.int64() == 0) return record;
  JobResult result;
  result.blob = column.text();
  result.bytes = column.int64();
  result.media_type = column.text();
  result.filename = column.text();
  result.grid = column.text();
  result.meta_json = column.text();
  result.warnings = parse_warnings(column.text());
  result.sequence = column.text();
  const int64_t frames = column.int64();
  if (frames > 0) status.frames_done = status.frames_total = frames;
  record.is_result_gone = column.int64() != 0;
  if (status.cached) result.filename = name_of_cached(status.filename, result.filename);
  status.result = std::move(result);
  return record;
}

Result<int64_t> number(SqlConnection& connection, std::string_view sql, int64_t parameter) {
  VOXELD_ASSIGN(SqlStatement row, connection.query(sql, parameter));
  VOXELD_ASSIGN(const bool found, row.step());
  return found ? row.int64(0) : int64_t{0};
}

// Counts from the end of the queue that is nearer, by order of arrival: a job that arrived just now
// costs nothing, and the one in the middle of the queue half of it.
Result<int64_t> place_in_queue(SqlConnection& connection, int64_t seq) {
  constexpr std::string_view kFirst =
      "SELECT seq FROM jobs WHERE state = 'queued' AND $1 = $1 ORDER BY seq LIMIT 1";
  constexpr std::string_view kLast =
      "SELECT seq FROM jobs WHERE state = 'queued' AND $1 = $1 ORDER BY seq DESC LIMIT 1";
  VOXELD_ASSIGN(const int64_t first, number(connection, kFirst, 0));
  VOXELD_ASSIGN(const int64_t last, number(connection, kLast, 0));
  if (seq - first <= last - seq) {
    constexpr std::string_view kUpTo =
        "SELECT COUNT(*) FROM jobs WHERE state = 'queued' AND seq <= $1";
    return number(connection, kUpTo, seq);
  }
  constexpr std::string_view kBehind =
      "SELECT COUNT(*) FROM jobs WHERE state = 'queued' AND seq > $1";
  VOXELD_ASSIGN(const LiveJobs live, live_jobs(connection));
  VOXELD_ASSIGN(const int64_t behind, number(connection, kBehind, seq));
  return live.queued - behind;
}

// Counts places in the queue: of many jobs in the order of arrival, each from the one before it.
class QueuePlaces {
 public:
  explicit QueuePlaces(SqlConnection& connection) : connection_(connection) {}

  Status fill(JobRecord& record) {
    if (record.status.state != JobState::kQueued) return {};
    if (seq_ == 0) {
      VOXELD_ASSIGN(place_, place_in_queue(connection_, record.seq));
    } else {
      const bool is_before = record.seq < seq_;
      VOXELD_ASSIGN(const int64_t between,
                    is_before ? count(record.seq, seq_) : count(seq_, record.seq));
      place_ += is_before ? -between : between;
    }
    seq_ = record.seq;
    record.status.queue_position = place_;
    return {};
  }

 private:
  // Waiting jobs after the first one, up to the last one.
  Result<int64_t> count(int64_t after, int64_t last) {
    VOXELD_ASSIGN(SqlStatement count,
                  connection_.query("SELECT COUNT(*) FROM jobs WHERE state = 'queued'"
                                    " AND seq > $1 AND seq <= $2",
                                    after, last));
    VOXELD_TRY(count.step());
    return count.int64(0);
  }

  SqlConnection& connection_;
  int64_t seq_ = 0, place_ = 0;  // of the job before; seq 0: there was none
};

}  // namespace

Error deadline_error() {
  return {ErrorCode::kDeadlineExceeded, "the job's deadline has passed", "", ""};
}

Result<JobRecord> load_job(SqlConnection& connection, const Caller& caller, std::string_view id,
                           JobTexts texts) {
  JobRecord record;
  {
    const std::string sql =
        select_of(texts) +
        (caller.sees_all() ? " WHERE j.id = $1 AND $2 = $2" : " WHERE j.id = $1 AND j.tenant = $2");
    VOXELD_ASSIGN(SqlStatement statement, connection.query(sql, id, caller.tenant()));
    VOXELD_ASSIGN(const bool found, statement.step());
    if (!found) {
      return Error{ErrorCode::kNotFound, "no such job", "the id of a job",
                   std::string(id.substr(0, 80))};
    }
    record = read_record(statement);
  }
  VOXELD_TRY(QueuePlaces(connection).fill(record));
  return record;
}

Status each_job(SqlConnection& connection, const Caller& caller, const JobQuery& query,
                const std::function<Result<bool>(JobRecord&&)>& take) {
  const bool is_newest_first = query.order == JobOrder::kNewestFirst;
  const int64_t after =
      query.after.value_or(is_newest_first ? std::numeric_limits<int64_t>::max() : 0);
  std::string sql = select_of(query.texts);
  sql += caller.sees_all() ? " WHERE $2 = $2" : " WHERE j.tenant = $2";
  sql += query.state ? " AND j.state = $3" : " AND $3 = $3";
  sql += is_newest_first ? " AND j.seq < $1 ORDER BY j.seq DESC" : " AND j.seq > $1 ORDER BY j.seq";
  VOXELD_ASSIGN(SqlStatement statement,
                connection.query(sql, after, caller.tenant(),
                                 query.state ? job_state_name(*query.state) : std::string_view()));
  QueuePlaces places(connection);
  while (true) {
    VOXELD_ASSIGN(const bool row, statement.step());
    if (!row) return {};
    JobRecord record = read_record(statement);
    VOXELD_TRY(places.fill(record));
    VOXELD_ASSIGN(const bool goes_on, take(std::move(record)));
    if (!goes_on) return {};
  }
}

std::string timings_text(const StageTimes& timings) {
  json list = json::array();
  for (const auto& [stage, ms] : timings) list.push_back(json::array({stage, ms}));
  return dump(list);
}

std::string warnings_text(const std::vector<Warning>& warnings) {
  json list = json::array();
  for (const Warning& warning : warnings) {
    list.push_back(json::array({warning.code, warning.detail}));
  }
  return dump(list);
}

}  // namespace voxeld
