// One HTTP exchange over libcurl, with bodies that stream in both directions.
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

struct HttpResponse;

struct HttpRequest {
  std::string method = "GET";
  std::string url;
  std::vector<std::string> headers;
  // Fills the buffer with the next part of the body; 0 at the end. Without `body_bytes` it is sent
  // chunked.
  std::function<size_t(std::span<std::byte>)> body;
  std::optional<long long> body_bytes;
  // Seconds that the daemon may hold its response back; they do not count against the timeout.
  std::chrono::seconds held{0};
  // Receives status and headers before the body; an exception ends the exchange.
  std::function<void(const HttpResponse&)> on_head;
  // Receives pieces of a 2xx response's body. Other bodies, and all if it is unset, go to
  // HttpResponse::body.
  std::function<void(std::span<const std::byte>)> sink;
  // Called often; returning false ends the exchange.
  std::function<bool()> keep_going;
};

struct HttpResponse {
  int status = 0;                              // 0: no response, see failure
  std::map<std::string, std::string> headers;  // lower-case names
  std::string body;
  long long sunk_bytes = 0;  // bytes passed to the sink
  enum class Failure {
    kNone,
    kUnreachable,
    kTimeout,
    kInterrupted,
    kBroken
  } failure = Failure::kNone;
  std::string failure_text;
};

// Keeps its connection between exchanges. For one thread.
class Transport {
 public:
  // `key`, unless empty, is sent with every request as its Authorization. Redirects are not
  // followed, so no other server receives the key.
  Transport(std::chrono::seconds connect_timeout, std::chrono::seconds timeout, std::string key);
  ~Transport();
  HttpResponse exchange(const HttpRequest& request);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::client
