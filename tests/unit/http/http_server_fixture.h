// An HTTP server on a free port of the loopback, with handlers of the test.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/http/http_server.h"
#include "tests/unit/http/http_client.h"

namespace voxeld::http {

using testing::comes_true;
using testing::HttpClient;
using testing::HttpResponse;
using testing::kPatienceSeconds;

// Facts of one exchange, as the observer saw them.
struct Observed {
  std::string method, path, request_id, peer;
  int status = 0;
  int64_t bytes_in = 0, bytes_out = 0;
};

// Waits until its client leaves or the test ends it.
class EndlessWait final : public Wait {
 public:
  struct Counts {
    std::atomic<int> entered{0}, abandoned{0};
    std::atomic<bool> ends{false};
  };
  explicit EndlessWait(Counts& counts) : counts_(counts) { ++counts_.entered; }
  std::optional<Response> look(Request&) override {
    if (counts_.ends) return Response::text(200, "ended");
    return std::nullopt;
  }
  Clock::time_point until() const override { return Clock::time_point::max(); }
  void abandon(Request&) override { ++counts_.abandoned; }

 private:
  Counts& counts_;
};

class HttpServerTest : public ::testing::Test {
 protected:
  HttpServerTest() {
    on("GET", "/hello", [](Request&) { return Response::text(200, "hello"); });
    // The body as it came, at most 1 MiB.
    on("POST", "/echo", [](Request&) {
      return TextBody{
          1 << 20, [](Request&, std::string text) { return Response::text(200, std::move(text)); }};
    });
    on("POST", "/ignore", [](Request&) { return Response::text(200, "ignored"); });
    // Waits for ever; responds when `waits_.ends` is set and it is woken.
    on("GET", "/endless", [this](Request& request) -> Reply {
      const std::lock_guard lock(wakers_mutex_);
      wakers_.push_back(request.waker);
      return std::unique_ptr<Wait>(std::make_unique<EndlessWait>(waits_));
    });
  }
  ~HttpServerTest() override {
    if (server_) server_->stop(0);
  }
  // Handlers are added before the server starts.
  void on(const std::string& method, const std::string& path, Handler handler) {
    handlers_[{method, path}] = std::move(handler);
  }
  void start(int threads = 4, int connections_max = 1000) {
    HttpServerConfig config;
    config.threads = threads;
    config.connections_max = connections_max;
    start_with(config);
  }
  // `config` without its address.
  void start_with(HttpServerConfig config) {
    config.listen = "127.0.0.1:0";
    auto server = start_http_server(
        config, [this](Request& request) { return dispatch(request); },
        [this](const ExchangeRecord& record) {
          const std::lock_guard lock(observed_mutex_);
          observed_.push_back({record.head->method, record.head->path, record.request_id,
                               record.peer, record.status, record.bytes_in, record.bytes_out});
        });
    ASSERT_TRUE(server) << server.error().message();
    server_ = *std::move(server);
  }
  int port() const { return server_->port(); }
  // Everything observed so far, once there are `count` of them.
  std::vector<Observed> observed(size_t count) {
    EXPECT_TRUE(comes_true([&] {
      const std::lock_guard lock(observed_mutex_);
      return observed_.size() >= count;
    }));
    const std::lock_guard lock(observed_mutex_);
    return observed_;
  }
  HttpResponse get(const std::string& target, const std::string& lines = "") {
    HttpClient client(port());
    EXPECT_TRUE(client.send_get(target, lines));
    return client.receive().value_or(HttpResponse{});
  }
  void wake_all() {
    const std::lock_guard lock(wakers_mutex_);
    for (const auto& waker : wakers_) waker->wake();
  }

  EndlessWait::Counts waits_;
  std::mutex observed_mutex_;
  std::vector<Observed> observed_;
  std::mutex wakers_mutex_;
  std::vector<std::shared_ptr<Waker>> wakers_;
  std::unique_ptr<HttpServer> server_;

 private:
  Reply dispatch(Request& request) {
    const auto found = handlers_.find({request.head.method, request.head.path});
    const bool is_head = request.head.method == "HEAD";
    const auto as_get = is_head ? handlers_.find({"GET", request.head.path}) : found;
    if (as_get != handlers_.end()) return as_get->second(request);
    return Response::problem({ErrorCode::kNotFound, "no such path", "", ""}, request.head.path);
  }

  std::map<std::pair<std::string, std::string>, Handler> handlers_;
};

}  // namespace voxeld::http
