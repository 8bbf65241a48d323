// A front on a free port of the loopback, with routes of the test.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/http/body_reader.h"
#include "server/http/front.h"
#include "server/http/router.h"
#include "tests/unit/http/http_client.h"

namespace voxeld::http {

using testing::comes_true;
using testing::HttpAnswer;
using testing::HttpClient;
using testing::kPatienceSeconds;

// Facts of one exchange, as the observer saw them.
struct Observed {
  std::string method, path, request_id, peer;
  int status = 0;
  int64_t bytes_in = 0, bytes_out = 0;
};

class FrontTest : public ::testing::Test {
 protected:
  FrontTest() {
    router_.add("GET", "/hello", [](Request&) { return Response::text(200, "hello"); });
    // The body as it came, at most 1 MiB.
    router_.add("POST", "/echo", [](Request& request) {
      auto text = request.body->read_text(1 << 20);
      return text ? Response::text(200, *text) : Response::problem(text.error(), request.head.path);
    });
    router_.add("POST", "/ignore", [](Request&) { return Response::text(200, "ignored"); });
  }
  ~FrontTest() override {
    if (front_) front_->stop(0);
  }
  void start(int threads = 4, int connections_max = 1000) {
    FrontConfig config;
    config.threads = threads;
    config.connections_max = connections_max;
    start_with(config);
  }
  // `config` without its address.
  void start_with(FrontConfig config) {
    config.listen = "127.0.0.1:0";
    auto front = start_front(
        config,
        [this](Request& request) {
          std::string route;
          return router_.dispatch(request, &route);
        },
        [this](const ExchangeRecord& record) {
          const std::lock_guard lock(observed_mutex_);
          observed_.push_back({record.head->method, record.head->path, record.request_id,
                               record.peer, record.status, record.bytes_in, record.bytes_out});
        });
    ASSERT_TRUE(front) << front.error().message();
    front_ = *std::move(front);
  }
  int port() const { return front_->port(); }
  // What was observed so far, when there are `count` of them.
  std::vector<Observed> observed(size_t count) {
    EXPECT_TRUE(comes_true([&] {
      const std::lock_guard lock(observed_mutex_);
      return observed_.size() >= count;
    }));
    const std::lock_guard lock(observed_mutex_);
    return observed_;
  }
  HttpAnswer get(const std::string& target, const std::string& lines = "") {
    HttpClient client(port());
    EXPECT_TRUE(client.send_get(target, lines));
    return client.receive().value_or(HttpAnswer{});
  }

  Router router_;
  std::mutex observed_mutex_;
  std::vector<Observed> observed_;
  std::unique_ptr<Front> front_;
};

}  // namespace voxeld::http
