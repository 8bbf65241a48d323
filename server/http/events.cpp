// /v1/jobs/{id}/events: server-sent events (WHATWG HTML, section 9.2), resumable by Last-Event-ID.
#include <charconv>
#include <memory>

#include "server/http/api.h"
#include "server/http/exchange.h"

namespace voxeld::http {
namespace {

constexpr int kPingSeconds = 15;

// Counts a subscriber as long as its stream lives.
class Subscription {
 public:
  explicit Subscription(std::atomic<int>& count) : count_(count) {}
  ~Subscription() { --count_; }
  Subscription(const Subscription&) = delete;
  Subscription& operator=(const Subscription&) = delete;

 private:
  std::atomic<int>& count_;
};

// A stream outlives the request that asked for it.
struct Subscriber {
  Caller caller;
  std::string key_id;
};

// Until the job has ended, the client is gone, its key is revoked or the server stops; a client
// that comes back later goes on after the last event that it saw.
void stream_events(EventSink& sink, Api& api, const Subscriber& who, const std::string& id,
                   int64_t after) {
  const auto over = [&] {
    return api.stopping || sink.client_gone() || !api.access.still_admits(who.key_id);
  };
  while (!over()) {
    // Short waits, so that a client that left frees its thread soon.
    const auto ping_at = JobService::Clock::now() + std::chrono::seconds(kPingSeconds);
    Result<std::vector<JobEvent>> events = std::vector<JobEvent>();
    while (events.ok() && events->empty() && JobService::Clock::now() < ping_at && !over()) {
      events = api.jobs.wait_events(who.caller, id, after,
                                    JobService::Clock::now() + std::chrono::milliseconds(500));
      if (events.ok() && events->empty()) {
        const auto status = api.jobs.get(who.caller, id);
        if (!status.ok() || (status->ended() && status->version <= after)) return;
      }
    }
    if (!events.ok()) return;
    if (events->empty() && !sink.write(": ping\n\n")) return;
    for (const JobEvent& event : *events) {
      after = event.id;
      if (!sink.write("id: " + std::to_string(event.id) + "\nevent: " + event.type +
                      "\ndata: " + event.data_json + "\n\n")) {
        return;
      }
    }
    const auto status = api.jobs.get(who.caller, id);
    if (!status.ok() || (status->ended() && status->version <= after)) return;
  }
}

Response get_events(Request& request, Api& api) {
  const std::string id = request.path_parameters[0];
  const auto status = api.jobs.get(request.caller, id);
  if (!status) return problem(request, status.error());
  int64_t after = 0;
  const std::string_view last = request.head.header("Last-Event-ID");
  if (!last.empty()) {
    const auto [end, error] = std::from_chars(last.data(), last.data() + last.size(), after);
    if (error != std::errc() || end != last.data() + last.size()) {
      return problem(request, {ErrorCode::kBadRequest, "Last-Event-ID", "the id of an event",
                               "\"" + header_safe(last.substr(0, 40)) + "\""});
    }
  }
  if (++api.subscribers > kSubscribersMax) {
    --api.subscribers;
    return problem(request, {ErrorCode::kTooManyRequests, "too many event streams",
                             "at most " + std::to_string(kSubscribersMax), "more"});
  }
  auto subscription = std::make_shared<Subscription>(api.subscribers);
  Response response;
  response.headers["Content-Type"] = "text/event-stream";
  response.headers["Cache-Control"] = "no-store";
  response.headers["X-Accel-Buffering"] = "no";
  const Subscriber who{request.caller, request.key_id};
  response.body = StreamBody([&api, who, id, after, subscription](EventSink& sink) {
    stream_events(sink, api, who, id, after);
  });
  return response;
}

}  // namespace

void add_event_routes(Router& router, Api& api) {
  router.add("GET", "/v1/jobs/{id}/events", [&api](Request& r) { return get_events(r, api); });
}

}  // namespace voxeld::http
