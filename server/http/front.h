// The front: accepts connections, gathers request heads without holding a thread, and hands
// complete ones to a bounded pool.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/http/answer_budget.h"
#include "server/http/connection.h"
#include "server/http/message.h"

namespace voxeld::http {

inline constexpr int kHeadSecondsMax = 10;   // from a request's first byte to its empty line
inline constexpr int kIdleSecondsMax = 120;  // between requests
inline constexpr int kLingerSecondsMax = 2;  // for a client to close after its last answer
// When all places are taken, a client that has been in its state for so long gives way to a new
// one: first idle ones, then those whose head, and then whose small body is not whole.
inline constexpr double kIdleSecondsMin = 1.0;
inline constexpr double kHeadSecondsMin = 1.0;
inline constexpr double kBodySecondsMin = 5.0;
// Bodies up to here are waited for without a thread.
inline constexpr int64_t kSmallBodyBytesMax = int64_t{16} << 10;
// Average bytes per second of an answer that its client must take after the first seconds.
inline constexpr int64_t kSendRateMin = 4096;
inline constexpr int kSendGraceSeconds = 60;

// When an answer is cut whose client does not take it.
struct SendLimits {
  double stall_seconds = kWriteStallSeconds;  // without a byte
  double grace_seconds = kSendGraceSeconds;   // until the average counts
  int64_t rate_min = kSendRateMin;
};

struct FrontConfig {
  std::string listen;  // "127.0.0.1:8080"; port 0 takes a free one
  int threads = 64;
  // More are closed at once, unless one gives way.
  int connections_max = 16384;
  // From one address that is neither loopback nor a trusted proxy; 0: any number.
  int connections_per_address = 256;
  // Addresses whose X-Forwarded-For is believed. From all others it is dropped, as are Forwarded,
  // X-Real-IP and X-Forwarded-*.
  std::vector<std::string> trusted_proxies = {};
  // Requests whose answers may wait for something (a job, an event): a quarter of the threads is
  // kept free of them, and of large and chunked bodies, which may come slowly. Null: none.
  std::function<bool(const Head&)> may_wait = nullptr;
  // Requests that are refused with shutting-down while the front drains. Null: none.
  std::function<bool(const Head&)> is_new_work = nullptr;
  SendLimits send = {};
  AnswerLimits answers = {};
};

// What the front tells of itself, for metrics.
struct FrontState {
  int64_t connections = 0;
  int64_t requests_running = 0;
  int64_t answer_bytes = 0;  // made and not yet taken
};

// A handler that goes on though its client was cut off.
struct RunningRequest {
  std::string what;  // "GET /v1/jobs"
  std::string peer;
  double seconds = 0;  // since its head was whole
};
// How long the end of a front waits for handlers whose clients it has cut off.
inline constexpr double kCutSecondsMax = 0.3;

// Answers one request; the front has parsed the head and owns the connection.
using Handler = std::function<Response(Request&)>;
// After each exchange: method, route-independent facts for logs and metrics.
struct ExchangeRecord {
  const Head* head = nullptr;
  std::string request_id, trace_id, peer;
  std::string tenant, key_id;  // empty where no key was needed or none was valid
  std::string route;           // the pattern that the handler found; empty where it saw none
  int status = 0;
  int64_t bytes_in = 0, bytes_out = 0;
  double ms = 0;
};
using Observer = std::function<void(const ExchangeRecord&)>;

class Front {
 public:
  virtual ~Front() = default;
  virtual int port() const = 0;
  virtual FrontState state() const = 0;
  // Drains for at most `seconds`, as long as anything runs that is not refused: new and kept
  // connections are served, each answer being their last. Then cuts what still runs, closes all.
  // Returns the requests whose handlers have not come back kCutSecondsMax later; what they use has
  // to stay, and the destructor waits for them.
  virtual std::vector<RunningRequest> stop(double seconds) = 0;
};

// Errors: internal with the address and the system's words.
Result<std::unique_ptr<Front>> start_front(const FrontConfig& config, Handler handler,
                                           Observer observer);

}  // namespace voxeld::http
