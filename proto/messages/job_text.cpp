#include "proto/messages/job_text.h"

#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "proto/messages/job_fields.h"
#include "proto/messages/json_fields.h"
#include "proto/messages/json_writer.h"

namespace voxeld {
namespace {

// The text if it is a JSON object, otherwise {}. voxeld writes meta and options itself.
std::string_view object_text(const std::string& text) {
  return text.starts_with('{') && nlohmann::json::accept(text) ? std::string_view(text) : "{}";
}

// Writes a status whose texts are cut at `bytes_max`: a visitor of its field list (json_fields.h).
class StatusWriter {
 public:
  StatusWriter(const JobStatus& status, size_t bytes_max)
      : status_(status), bytes_max_(bytes_max) {}
  std::string text() {
    return object([&] {
      visit_changing_fields(status_, *this);
      write_fixed();
    });
  }
  std::string changing_text() {
    return object([&] { visit_changing_fields(status_, *this); });
  }
  std::string fixed_text(bool with_result) {
    with_result_ = with_result;
    return object([&] { write_fixed(); });
  }

  void name(std::string_view) {}
  template <typename T, typename Rule = AnyValue>
  void operator()(Need need, const char* name, const T& value, const Rule& = {}) {
    if (!is_absent(need, value)) write(name, value);
  }

 private:
  std::string object(const auto& write_members) {
    json_.begin_object();
    write_members();
    json_.end_object();
    return std::move(text_);
  }
  void write_fixed() {
    visit_fixed_fields(status_, *this);
    if (left_out_.empty()) return;
    json_.key("left_out").begin_array();
    for (const std::string_view name : left_out_) json_.value(name);
    json_.end_array();
  }

  template <typename T>
  void write(const char* name, const T& value) {
    if constexpr (HasWords<T>) {
      json_.member(name, word_of(value));
    } else if constexpr (std::is_arithmetic_v<T>) {
      json_.member(name, value);
    } else if constexpr (kIsOptional<T>) {
      write(name, *value);
    } else {
      json_.key(name).begin_object();
      visit_fields(value, *this);
      json_.end_object();
    }
  }
  // A text keeps its meaning when it is cut.
  void write(const char* name, const std::string& text) {
    json_.member(name, std::string_view(text).substr(0, bytes_max_));
  }
  void write(const char* name, const std::optional<JobResult>& result) {
    if (with_result_) write(name, *result);
  }
  void write(const char* name, const CodeName<const ErrorCode>& of) {
    json_.member(name, info_of(of.code).name);
  }
  // The text of a JSON object cannot be cut: a longer one is omitted.
  void write(const char* name, const ObjectText& of) {
    const bool is_row = bytes_max_ == limits::kRowTextBytesMax;
    if (of.text.size() > bytes_max_ || (is_row && of.text.empty())) {
      return left_out_.push_back(name);
    }
    json_.key(name).raw(object_text(of.text));
  }
  // Timings that are too many for a row are omitted.
  void write(const char* name, const StageTimes& times) {
    std::string timings;
    JsonWriter json(timings);
    json.begin_object();
    for (const auto& [stage, ms] : times) json.member(stage, ms);
    json.end_object();
    json_.key(name).raw(timings.size() > bytes_max_ ? "{}" : std::string_view(timings));
  }
  void write(const char* name, const std::vector<Warning>& warnings) {
    const size_t start = text_.size();
    json_.key(name).begin_array();
    const size_t list_start = text_.size() - 1;
    for (const Warning& warning : warnings) {
      json_.begin_object();
      visit_fields(warning, *this);
      json_.end_object();
    }
    json_.end_array();
    if (text_.size() - list_start <= bytes_max_) return;
    text_.resize(start);
    write(name, std::vector<Warning>{warnings_left_out()});
  }

  const JobStatus& status_;
  const size_t bytes_max_;
  bool with_result_ = true;
  std::string text_;
  JsonWriter json_{text_};
  std::vector<std::string_view> left_out_;
};

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
