// One HTTP exchange over libcurl, with a body that streams in both directions.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace voxeld::client {

struct HttpAnswer;

struct HttpRequest {
  std::string method = "GET";
  std::string url;
  std::vector<std::string> headers;
  // Body: filled into the buffer, 0 at the end. Without `body_bytes` it is sent chunked.
  std::function<size_t(std::span<std::byte>)> body;
  std::optional<long long> body_bytes;
  // Seconds that the daemon was asked to hold its answer back; they do not count to the timeout.
  std::chrono::seconds held{0};
  // Gets status and headers before any of the body; what it throws ends the exchange.
  std::function<void(const HttpAnswer&)> on_head;
  // Pieces of a 2xx answer's body; other bodies (and all, when unset) come in HttpAnswer::body.
  std::function<void(std::span<const std::byte>)> sink;
  // Called often; false ends the exchange.
  std::function<bool()> keep_going;
};

struct HttpAnswer {
  int status = 0;                              // 0: there was no answer, see failure
  std::map<std::string, std::string> headers;  // lower-case names
  std::string body;
  long long sunk_bytes = 0;  // that went to the sink
  enum class Failure {
    kNone,
    kUnreachable,
    kTimeout,
    kInterrupted,
    kBroken
  } failure = Failure::kNone;
  std::string failure_text;
};

// Keeps its connection between exchanges. One thread.
class Transport {
 public:
  // `key`, unless it is empty, goes with every request as its Authorization. Redirects are not
  // followed, so that no other server gets it.
  Transport(std::chrono::seconds connect_timeout, std::chrono::seconds timeout, std::string key);
  ~Transport();
  HttpAnswer exchange(const HttpRequest& request);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::client
