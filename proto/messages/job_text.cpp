#include "proto/messages/job_text.h"

#include <limits>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "proto/messages/json_writer.h"

namespace voxeld {
namespace {

// The text if it is a JSON object, otherwise {}. voxeld writes meta and options itself.
std::string_view object_text(const std::string& text) {
  return text.starts_with('{') && nlohmann::json::accept(text) ? std::string_view(text) : "{}";
}

// Writes a status whose texts are cut at `bytes_max`.
class StatusWriter {
 public:
  StatusWriter(const JobStatus& status, size_t bytes_max)
      : status_(status), bytes_max_(bytes_max) {}
  std::string text() {
    json_.begin_object();
    write_changing();
    write_fixed(true);
    json_.end_object();
    return std::move(text_);
  }
  std::string changing_text() {
    json_.begin_object();
    write_changing();
    json_.end_object();
    return std::move(text_);
  }
  std::string fixed_text(bool with_result) {
    json_.begin_object();
    write_fixed(with_result);
    json_.end_object();
    return std::move(text_);
  }

 private:
  void write_changing();
  void write_fixed(bool with_result);
  void write_result(const JobResult& result);
  void write_error(const Error& error);
  void write_estimate(const JobEstimate& estimate);
  void write_left_out();
  // Writes a text that keeps its meaning when it is cut.
  void member(std::string_view name, std::string_view text) {
    json_.member(name, text.substr(0, bytes_max_));
  }
  // Writes the text of a JSON object, which cannot be cut: a longer one is omitted.
  void long_member(std::string_view name, const std::string& text);
  void write_timings();
  void write_warnings(const std::vector<Warning>& warnings);

  const JobStatus& status_;
  const size_t bytes_max_;
  std::string text_;
  JsonWriter json_{text_};
  std::vector<std::string_view> left_out_;
};

void StatusWriter::long_member(std::string_view name, const std::string& text) {
  const bool is_row = bytes_max_ == limits::kRowTextBytesMax;
  if (text.size() > bytes_max_ || (is_row && text.empty())) return left_out_.push_back(name);
  json_.key(name).raw(object_text(text));
}

void StatusWriter::write_changing() {
  json_.member("id", status_.id)
      .member("kind", job_kind_name(status_.kind))
      .member("state", job_state_name(status_.state))
      .member("asset", status_.asset)
      .member("grid", status_.grid)
      .member("sequence", status_.sequence)
      .member("version", status_.version)
      .member("attempt", status_.attempt)
      .member("preempted", status_.preempted)
      .member("tiles_done", status_.tiles_done)
      .member("tiles_total", status_.tiles_total)
      .member("frames_done", status_.frames_done)
      .member("frames_total", status_.frames_total)
      .member("queue_position", status_.queue_position)
      .member("created_ms", status_.created_ms)
      .member("started_ms", status_.started_ms)
      .member("ended_ms", status_.ended_ms)
      .member("priority", status_.priority)
      .member("deadline_at_ms", status_.deadline_at_ms)
      .member("device_ms", status_.device_ms)
      .member("cached", status_.cached);
  member("filename", status_.filename);
  member("stage", status_.stage);
  member("waiting_for", status_.waiting_for);
  write_timings();
  if (status_.error) write_error(*status_.error);
  if (status_.estimate) write_estimate(*status_.estimate);
  if (status_.expected_start_ms > 0) json_.member("expected_start_ms", status_.expected_start_ms);
  if (status_.expected_end_ms > 0) json_.member("expected_end_ms", status_.expected_end_ms);
}

void StatusWriter::write_fixed(bool with_result) {
  long_member("options", status_.options_json);
  if (with_result && status_.result) write_result(*status_.result);
  write_left_out();
}

void StatusWriter::write_result(const JobResult& result) {
  json_.key("result").begin_object().member("blob", result.blob).member("bytes", result.bytes);
  member("media_type", result.media_type);
  member("filename", result.filename);
  json_.member("grid", result.grid).member("sequence", result.sequence);
  long_member("meta", result.meta_json);
  write_warnings(result.warnings);
  json_.end_object();
}

// Timings that are too many for a row are omitted.
void StatusWriter::write_timings() {
  std::string timings;
  JsonWriter json(timings);
  json.begin_object();
  for (const auto& [stage, ms] : status_.timings) json.member(stage, ms);
  json.end_object();
  json_.key("timings").raw(timings.size() > bytes_max_ ? "{}" : std::string_view(timings));
}

void StatusWriter::write_warnings(const std::vector<Warning>& warnings) {
  std::string list;
  JsonWriter json(list);
  json.begin_array();
  for (const Warning& warning : warnings) {
    json.begin_object();
    json.member("code", warning.code).member("detail", warning.detail).end_object();
  }
  json.end_array();
  if (list.size() > bytes_max_) return write_warnings({warnings_left_out()});
  json_.key("warnings").raw(list);
}

void StatusWriter::write_error(const Error& error) {
  json_.key("error").begin_object().member("code", info_of(error.code).name);
  member("detail", error.detail);
  if (!error.expected.empty()) member("expected", error.expected);
  if (!error.got.empty()) member("got", error.got);
  json_.end_object();
}

void StatusWriter::write_estimate(const JobEstimate& estimate) {
  json_.key("estimate")
      .begin_object()
      .member("seconds", estimate.seconds)
      .member("seconds_low", estimate.seconds_low)
      .member("seconds_high", estimate.seconds_high)
      .member("device_seconds", estimate.device_seconds)
      .member("result_bytes", estimate.result_bytes)
      .member("host_bytes", estimate.host_bytes)
      .member("learned_from", estimate.learned_from)
      .end_object();
}

void StatusWriter::write_left_out() {
  if (left_out_.empty()) return;
  json_.key("left_out").begin_array();
  for (const std::string_view name : left_out_) json_.value(name);
  json_.end_array();
}

}  // namespace

std::string job_status_text(const JobStatus& status) {
  return StatusWriter(status, std::numeric_limits<size_t>::max()).text();
}

std::string job_row_text(const JobStatus& status) {
  return StatusWriter(status, limits::kRowTextBytesMax).text();
}

std::string job_event_text(const JobStatus& status) {
  return StatusWriter(status, limits::kRowTextBytesMax).changing_text();
}

std::string with_fixed_members(std::string event_text, const JobStatus& status) {
  // Inside of a JSON text, quotes are escaped: this can only be the member.
  const bool is_done = event_text.find(R"("state":"done")") != std::string::npos;
  const std::string fixed = StatusWriter(status, limits::kRowTextBytesMax).fixed_text(is_done);
  if (fixed.size() <= 2 || !event_text.ends_with('}')) return event_text;  // {}: nothing to add
  event_text.back() = ',';
  return event_text + fixed.substr(1);
}

Warning warnings_left_out() {
  return {std::string(kWarningsLeftOut), "too many warnings for a list; the job itself has them"};
}

bool is_brief(const JobStatus& status) {
  if (status.options_json.empty()) return true;
  if (!status.result) return false;
  const std::vector<Warning>& warnings = status.result->warnings;
  return status.result->meta_json.empty() ||
         (warnings.size() == 1 && warnings[0].code == kWarningsLeftOut);
}

}  // namespace voxeld
