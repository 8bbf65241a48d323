// The HTTP/1.1 server: accepts connections, and serves any number of them that wait, read slowly or
// send slowly with a bounded number of threads.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/http/exchange.h"
#include "server/http/memory_budget.h"
#include "server/http/message/message.h"
#include "server/http/send_limits.h"
#include "server/store/held_files.h"

namespace voxeld::http {

inline constexpr int kHeadSecondsMax = 10;   // from a request's first byte to its empty line
inline constexpr int kIdleSecondsMax = 120;  // between requests
inline constexpr int kLingerSecondsMax = 2;  // for a client to close after its last response
// When all places are taken, a client that has been in its state for so long is closed for a new
// one: first idle ones, then those with an incomplete head, then those with a body that has stopped
// arriving.
inline constexpr double kIdleSecondsMin = 1.0;
inline constexpr double kHeadSecondsMin = 1.0;
inline constexpr double kBodySecondsMin = 5.0;

struct HttpServerConfig {
  std::string listen;  // "127.0.0.1:8080"; port 0 takes a free one
  // Each runs a handler, reads or sends; none waits for a client or a job.
  int threads = 64;
  // More are closed at once, unless one can be closed for them.
  int connections_max = 16384;
  // From one address that is neither loopback nor a trusted proxy; 0: any number.
  int connections_per_address = 256;
  // Addresses whose X-Forwarded-For is believed. From all others it is dropped, as are Forwarded,
  // X-Real-IP and X-Forwarded-*.
  std::vector<std::string> trusted_proxies = {};
  // Requests that are refused with shutting-down while the server drains. Null: none.
  std::function<bool(const Head&)> is_new_work = nullptr;
  // Asked a few times a second; true: every waiting exchange looks again. For changes that are not
  // announced by wakers, as of API keys. Null: never.
  std::function<bool()> is_recheck_due = nullptr;
  // Completes the headers of each response to a request with a valid head. Null: adds none.
  std::function<void(const Request&, Response&)> add_headers = nullptr;
  SendLimits send = {};
  HeldFiles* held_files = nullptr;  // of responses; null: nobody counts them
  // Asked a few times a second; true: downloads keep room from others. Null: never.
  std::function<bool()> is_disk_short = nullptr;
  MemoryLimits memory = {};  // of responses, and once more of request bodies
};

// Gauges of a server, for metrics.
struct HttpServerState {
  int64_t connections = 0;
  int64_t requests_running = 0;  // on a thread
  int64_t requests_waiting = 0;  // for a job, an event or the time
  int64_t memory_bytes = 0;      // of exchanges, as MemoryBudget counts them
  bool is_draining = false;      // stop() was called
};

// A handler that still runs although its client was cut off.
struct RunningRequest {
  std::string what;  // "GET /v1/jobs"
  std::string peer;
  double seconds = 0;  // since its head was complete
};
// How long stop() waits for handlers whose clients it has cut off.
inline constexpr double kCutSecondsMax = 0.3;

// Called after each exchange.
using Observer = std::function<void(const ExchangeRecord&)>;

class HttpServer {
 public:
  virtual ~HttpServer() = default;
  virtual int port() const = 0;
  virtual HttpServerState state() const = 0;
  // Requests from their complete head to the last byte of the response.
  virtual size_t requests_in_flight() = 0;
  // Every waiting exchange looks again.
  virtual void wake_waiting() = 0;
  // Drains for at most `seconds`, until only refused requests run. Meanwhile new and open
  // connections are served, each with one last response. Then cuts running requests and closes all
  // connections. Returns the requests whose handlers have not returned kCutSecondsMax later.
  // Objects that they use must outlive them; the destructor waits for them.
  virtual std::vector<RunningRequest> stop(double seconds) = 0;
};

// Errors: internal with the address and the system's words.
Result<std::unique_ptr<HttpServer>> start_http_server(const HttpServerConfig& config,
                                                      Handler handler, Observer observer);

}  // namespace voxeld::http
