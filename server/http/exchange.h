// One request and its response, as a state machine that never waits for its client.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/http/memory_budget.h"
#include "server/http/message/body_decoder.h"
#include "server/http/message/message.h"
#include "server/http/output.h"
#include "server/http/sockets/connection.h"
#include "server/store/held_files.h"

namespace voxeld::http {

// Bodies up to here are held as text without counting against the memory budget.
inline constexpr int64_t kSmallBodyBytesMax = int64_t{16} << 10;
// Status of an exchange that ended before it had a response; never sent.
inline constexpr int kClientClosedStatus = 499;

// Makes something of a request whose head is complete; bodies come later, by TextBody and
// StreamedBody. Thread-safe, and quick: it holds a thread of the server.
using Handler = std::function<Reply(Request&)>;

// Facts of an exchange, for logs and metrics.
struct ExchangeRecord {
  const Head* head = nullptr;
  std::string request_id, trace_id, peer;
  std::string tenant, key_id;  // empty if no key was needed or none was valid
  std::string route;           // pattern of the route; empty if none matched
  int status = 0;
  int64_t bytes_in = 0, bytes_out = 0;
  double ms = 0;
};

// Not thread-safe: one thread at a time, the one that has the connection.
class Exchange {
 public:
  // The parts of a server that its exchanges share.
  struct Context {
    const Handler& handler;
    const std::function<void(const Request&, Response&)>& add_headers;  // may be null
    const std::vector<std::string>& trusted_proxies;
    MemoryBudget& response_budget;
    // Apart, so that bodies that arrive slowly delay no response.
    MemoryBudget& body_budget;
    const std::atomic<bool>& is_draining;  // each response is its connection's last
    HeldFiles* held_files = nullptr;       // null: nobody counts them
  };
  // `head`: as parsed, or what is wrong with it. `is_refused`: the response is shutting-down.
  // `owner` is what MemoryBudget::grant() hands back.
  Exchange(const Context& context, Connection& connection, Result<Head> head, bool is_refused,
           std::shared_ptr<Waker> waker, void* owner);
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;

  // The event that it waits for, or its end.
  enum class Step {
    kReadBody,    // for more bytes in the connection's buffer
    kWait,        // for its waker, or wait_until()
    kNeedMemory,  // for MemoryBudget::grant()
    kSend,        // for the socket to take more
    kDone,        // the response has been sent
    kBroken,      // the connection is of no use any more
  };
  // Goes on as far as it can.
  Step advance();
  // Ends the body with an error, which advance() sends as the response. Only after kReadBody.
  void fail_body(const Error& error);
  // The client has left before its response; nothing else is called then.
  void abandon();

  Clock::time_point wait_until() const;
  // Whether the body that is being read has come too slowly so far.
  bool is_body_too_slow() const;
  // Whether the connection can serve another request; after kDone.
  bool keeps_connection() const { return keep_; }
  bool is_refused() const { return is_refused_; }
  // When its response began; nullopt before that.
  std::optional<Clock::time_point> responded() const { return responded_; }
  // Bytes of the response that the socket has taken.
  int64_t sent() const { return output_ ? output_->sent() : 0; }
  // Whether it sends a file that was deleted; any file where the disk is short.
  bool keeps_room(bool is_disk_short) const {
    if (!output_) return false;
    return is_disk_short ? output_->sends_file() : output_->sends_deleted_file();
  }
  // Complete but for its duration.
  ExchangeRecord record() const;
  // "GET /v1/jobs", for logs.
  std::string description() const;

 private:
  enum class Stage { kHandler, kBody, kWait, kSend };

  // The tenant whose memory it takes; empty if no key was needed or none was valid.
  std::string tenant() const;
  Reply handle();
  Reply guarded(const std::function<Reply()>& call) const;
  Response unexpected(const std::exception& failure) const;
  std::optional<Response> look();
  void use(Reply reply);
  void respond(Response response);
  void begin_body(int64_t bytes_max, std::unique_ptr<BodySink> sink, int64_t memory_bytes);
  // nullopt: the body is whole, and its sink has replied.
  std::optional<Step> advance_body();
  // Frees all that the body took, since the response may be hours away.
  void end_body();
  Step send();

  const Context context_;
  Connection& connection_;
  void* const owner_;
  const bool is_refused_;
  std::optional<Error> bad_head_;
  Request request_;
  std::string peer_;
  Stage stage_ = Stage::kHandler;
  bool keep_ = false, is_body_whole_ = false;

  // --- kBody
  std::optional<BodyDecoder> decoder_;
  std::unique_ptr<BodySink> sink_;
  std::unique_ptr<MemoryShare> body_share_;  // null: small, or not held in memory
  int64_t body_memory_bytes_ = 0;            // still to be reserved
  Clock::time_point body_started_{};
  int64_t bytes_in_ = 0;  // of a body that has ended
  // --- kWait
  std::unique_ptr<Wait> wait_;
  // --- kSend
  std::unique_ptr<Output> output_;
  std::optional<Clock::time_point> responded_;
};

}  // namespace voxeld::http
