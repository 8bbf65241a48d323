// /v1/jobs/{id}/events: server-sent events (WHATWG HTML, section 9.2), resumable by Last-Event-ID.
#include <algorithm>
#include <memory>
#include <utility>

#include "proto/text/number_text.h"
#include "server/api/resources/jobs/job_wait.h"
#include "server/api/resources/resources.h"

namespace voxeld::api {
namespace {

// A comment is sent after so long without an event, so that proxies keep the connection.
constexpr auto kPingPeriod = std::chrono::seconds(15);

// Counts an open stream, for metrics.
class StreamCount {
 public:
  explicit StreamCount(std::atomic<int>& count) : count_(count) { ++count_; }
  ~StreamCount() { --count_; }
  StreamCount(const StreamCount&) = delete;
  StreamCount& operator=(const StreamCount&) = delete;

 private:
  std::atomic<int>& count_;
};

// The events of one job, until it has ended, the key of the request has ended or the server drains.
class EventStream {
 public:
  EventStream(const Request& request, Api& api, std::string job, int64_t after, WaitPlace place)
      : api_(api),
        caller_(request.caller),
        key_id_(request.key_id),
        job_(std::move(job)),
        after_(after),
        place_(std::move(place)),
        count_(api.event_streams),
        watch_(api.jobs.watch(job_, JobChange::kAny, request.waker)) {}

  Result<Piece> next() {
    if (api_.stopping || !api_.access.still_admits(key_id_)) return Piece{"", true};
    VOXELD_ASSIGN(const std::vector<JobEvent> events, api_.jobs.events(caller_, job_, after_));
    std::string text;
    for (const JobEvent& event : events) {
      if (std::ssize(text) >= kPieceBytesMax) break;  // the rest is read again
      text += "id: " + std::to_string(event.id) + "\nevent: " + event.type +
              "\ndata: " + event.data_json + "\n\n";
      after_ = event.id;
    }
    if (text.empty()) {
      VOXELD_ASSIGN(const JobStatus status, api_.jobs.get(caller_, job_));
      if (status.ended() && status.version <= after_) return Piece{"", true};
      if (Clock::now() < ping_at_) return Piece{"", false, ping_at_};
      text = ": ping\n\n";
    }
    ping_at_ = Clock::now() + kPingPeriod;
    return Piece{std::move(text), false};
  }

 private:
  Api& api_;
  const Caller caller_;
  const std::string key_id_, job_;
  int64_t after_;
  const WaitPlace place_;
  const StreamCount count_;
  const std::unique_ptr<JobWatch> watch_;
  Clock::time_point ping_at_ = Clock::now() + kPingPeriod;
};

}  // namespace

Reply get_events(Request& request, Api& api) {
  const std::string& id = request.path_parameters[0];
  const auto status = api.jobs.get(request.caller, id);
  if (!status) return problem(request, status.error());
  int64_t after = 0;
  const std::string_view last = request.head.header("Last-Event-ID");
  if (!last.empty()) {
    const auto id_seen = parse_number<int64_t>(last);
    if (!id_seen) {
      return problem(request, {ErrorCode::kBadRequest, "Last-Event-ID", "the id of an event",
                               "\"" + header_safe(last.substr(0, 40)) + "\""});
    }
    after = *id_seen;
  }
  Response response;
  if (status->ended() && status->version <= after) {
    response.status = 204;  // an EventSource asks no more
    return response;
  }
  auto place = api.waits.take(request.caller.tenant());
  if (!place) return problem(request, place.error());
  response.headers["Content-Type"] = "text/event-stream";
  response.headers["Cache-Control"] = "no-store";
  response.headers["X-Accel-Buffering"] = "no";
  response.close = true;
  const auto stream = std::make_shared<EventStream>(request, api, id, after, *std::move(place));
  response.body = PieceBody{[stream] { return stream->next(); }};
  return response;
}

}  // namespace voxeld::api
