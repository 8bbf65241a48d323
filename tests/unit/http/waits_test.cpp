// Responses that wait: timers, wakers, streams, and memory for bodies.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "tests/unit/base/heap_bytes.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/http/coding.h"
#include "tests/unit/http/http_server_fixture.h"

namespace voxeld::http {
namespace {

using std::chrono::milliseconds;

// Responds at a time of its own.
class TimedWait final : public Wait {
 public:
  // The times of those that have responded, in the order in which they did.
  struct Ended {
    std::mutex mutex;
    std::vector<Clock::time_point> times;
  };
  TimedWait(Ended& ended, milliseconds delay) : ended_(ended), until_(Clock::now() + delay) {}
  std::optional<Response> look(Request&) override {
    if (Clock::now() < until_) return std::nullopt;
    const std::lock_guard lock(ended_.mutex);
    ended_.times.push_back(until_);
    return Response::text(200, "late");
  }
  Clock::time_point until() const override { return until_; }

 private:
  Ended& ended_;
  const Clock::time_point until_;
};

class WaitsTest : public HttpServerTest {
 protected:
  // A path that waits for so long.
  void add_timed(const std::string& path, milliseconds delay) {
    on("GET", path, [this, delay](Request&) -> Reply {
      return std::unique_ptr<Wait>(std::make_unique<TimedWait>(ended_, delay));
    });
  }

  TimedWait::Ended ended_;
};

TEST_F(WaitsTest, each_wait_ends_at_its_own_time_in_whatever_order_they_began) {
  add_timed("/long", milliseconds(700));
  add_timed("/short", milliseconds(50));
  start(/*threads=*/1);
  HttpClient slow(port()), quick(port());
  ASSERT_TRUE(slow.send_get("/long"));
  ASSERT_TRUE(comes_true([&] { return server_->state().requests_waiting == 1; }));
  ASSERT_TRUE(quick.send_get("/short"));
  EXPECT_EQ(quick.receive().value_or(HttpResponse{}).body, "late");
  EXPECT_EQ(slow.receive().value_or(HttpResponse{}).body, "late");
  // The short one is first, unless the machine paused for 650 ms between the two requests.
  const std::lock_guard lock(ended_.mutex);
  EXPECT_EQ(ended_.times.size(), 2u);
  EXPECT_TRUE(std::ranges::is_sorted(ended_.times));
}

TEST_F(WaitsTest, a_connection_serves_requests_after_one_that_waited) {
  add_timed("/short", milliseconds(20));
  start();
  HttpClient client(port());
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(client.send_get("/short") && client.send_get("/hello"));
    EXPECT_EQ(client.receive().value_or(HttpResponse{}).body, "late");
    EXPECT_EQ(client.receive().value_or(HttpResponse{}).body, "hello");
  }
}

TEST_F(WaitsTest, wakes_from_many_threads_lose_nothing) {
  // Each request ends at its own tenth wake.
  class CountingWait final : public Wait {
   public:
    std::optional<Response> look(Request&) override {
      if (++looks_ < 10) return std::nullopt;
      return Response::text(200, "enough");
    }
    Clock::time_point until() const override { return Clock::time_point::max(); }

   private:
    int looks_ = 0;
  };
  on("GET", "/counting", [this](Request& request) -> Reply {
    const std::lock_guard lock(wakers_mutex_);
    wakers_.push_back(request.waker);
    return std::unique_ptr<Wait>(std::make_unique<CountingWait>());
  });
  start();
  std::vector<HttpClient> clients;
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(clients.emplace_back(port()).send_get("/counting"));
  }
  std::atomic<bool> done{false};
  std::vector<std::thread> wakers;
  for (int i = 0; i < 3; ++i) {
    wakers.emplace_back([&] {
      while (!done) wake_all();
    });
  }
  for (HttpClient& client : clients) {
    EXPECT_EQ(client.receive().value_or(HttpResponse{}).body, "enough");
  }
  done = true;
  for (std::thread& waker : wakers) waker.join();
}

TEST_F(WaitsTest, an_exception_while_waiting_is_an_internal_error) {
  class ThrowingWait final : public Wait {
   public:
    std::optional<Response> look(Request&) override { throw std::bad_alloc(); }
    Clock::time_point until() const override { return Clock::time_point::max(); }
  };
  on("GET", "/throwing",
     [](Request&) -> Reply { return std::unique_ptr<Wait>(std::make_unique<ThrowingWait>()); });
  start();
  EXPECT_EQ(get("/throwing").status, 500);
}

TEST_F(WaitsTest, a_recheck_wakes_everything_that_waits) {
  HttpServerConfig config;
  config.is_recheck_due = [this] { return waits_.ends.load(); };
  start_with(config);
  HttpClient client(port());
  ASSERT_TRUE(client.send_get("/endless"));
  ASSERT_TRUE(comes_true([&] { return server_->state().requests_waiting == 1; }));
  waits_.ends = true;
  EXPECT_EQ(client.receive().value_or(HttpResponse{}).body, "ended");
}

class StreamTest : public HttpServerTest {
 protected:
  StreamTest() {
    // Sends as many events as the test has given, one by one.
    on("GET", "/stream", [this](Request& request) {
      {
        const std::lock_guard lock(wakers_mutex_);
        wakers_.push_back(request.waker);
      }
      Response response = Response::text(200, "");
      response.body = PieceBody{[this, sent = 0]() mutable -> Result<Piece> {
        if (sent == events_) {
          if (is_over_) return Piece{"", true};
          return Piece{"", false, Clock::now() + std::chrono::hours(1)};
        }
        return Piece{"event " + std::to_string(sent++) + "\n", false};
      }};
      return response;
    });
  }
  std::atomic<int> events_{0};
  std::atomic<bool> is_over_{false};
};

TEST_F(StreamTest, a_stream_sends_its_head_at_once_and_each_event_when_it_is_woken) {
  start(/*threads=*/1);
  HttpClient client(port());
  ASSERT_TRUE(client.send_get("/stream"));
  const auto head = client.receive_head();
  ASSERT_TRUE(head);
  EXPECT_EQ(head->header("transfer-encoding"), "chunked");
  ASSERT_TRUE(comes_true([&] { return server_->state().requests_waiting == 1; }));
  EXPECT_EQ(get("/hello").body, "hello") << "it holds no thread";
  for (int i = 0; i < 3; ++i) {
    ++events_;
    wake_all();
    EXPECT_EQ(client.receive_some(), "8\r\nevent " + std::to_string(i) + "\n\r\n");
  }
  is_over_ = true;
  wake_all();
  EXPECT_EQ(client.receive_some(), "0\r\n\r\n");
  ASSERT_TRUE(client.send_get("/hello"));
  EXPECT_EQ(client.receive().value_or(HttpResponse{}).body, "hello");
}

TEST_F(StreamTest, a_stream_ends_when_its_client_leaves) {
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send_get("/stream") && client.receive_head());
  client.close();
  EXPECT_TRUE(comes_true([&] { return server_->state().connections == 0; }));
}

TEST_F(StreamTest, a_head_request_of_a_stream_gets_the_head_alone) {
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send("HEAD /stream HTTP/1.1\r\nHost: h\r\n\r\n"));
  EXPECT_EQ(client.receive(/*has_body=*/false).value_or(HttpResponse{}).status, 200);
  ASSERT_TRUE(client.send_get("/hello"));
  EXPECT_EQ(client.receive().value_or(HttpResponse{}).body, "hello");
}

TEST_F(StreamTest, a_stream_is_cut_at_the_end_of_the_grace) {
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send_get("/stream") && client.receive_head());
  server_->stop(0);
  EXPECT_EQ(client.receive_to_end(), "");
}

TEST_F(HttpServerTest, bodies_over_the_memory_budget_wait_for_each_other) {
  constexpr size_t kBodyBytes = 60'000;
  HttpServerConfig config;
  config.threads = 2;
  config.memory = {kBodyBytes, kBodyBytes};
  start_with(config);
  const std::string head =
      "POST /echo HTTP/1.1\r\nHost: h\r\nContent-Length: " + std::to_string(kBodyBytes) +
      "\r\n\r\n";
  std::vector<HttpClient> clients;
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(clients.emplace_back(port()).send(head));
  }
  ASSERT_TRUE(comes_true([&] { return server_->state().memory_bytes > 0; }));
  EXPECT_EQ(server_->state().memory_bytes, static_cast<int64_t>(kBodyBytes));
  const std::string body(kBodyBytes, 'b');
  for (HttpClient& client : clients) ASSERT_TRUE(client.send(body));
  for (HttpClient& client : clients) {
    EXPECT_TRUE(client.receive().value_or(HttpResponse{}).body == body);
  }
  EXPECT_TRUE(comes_true([&] { return server_->state().memory_bytes == 0; }));
}

// --- memory of bodies that have ended

// Drops its body, then waits as EndlessWait does.
class SinkThatWaits final : public BodySink {
 public:
  explicit SinkThatWaits(EndlessWait::Counts& counts) : counts_(counts) {}
  Status take(std::span<const uint8_t>) override { return {}; }
  Reply finish(Request&) override {
    return std::unique_ptr<Wait>(std::make_unique<EndlessWait>(counts_));
  }

 private:
  EndlessWait::Counts& counts_;
};

TEST_F(HttpServerTest, a_request_that_waits_keeps_no_decoder_of_its_body) {
  constexpr int kClients = 100;
  on("POST", "/wait", [this](Request&) {
    return StreamedBody{1 << 20, std::make_unique<SinkThatWaits>(waits_)};
  });
  start();
  const std::string body = testing::gzip("a mesh");
  const std::string head =
      "POST /wait HTTP/1.1\r\nHost: h\r\nContent-Encoding: gzip\r\nContent-Length: " +
      std::to_string(body.size()) + "\r\n\r\n";
  std::vector<HttpClient> clients;
  const int64_t before = testing::heap_bytes();
  for (int i = 0; i < kClients; ++i) {
    ASSERT_TRUE(clients.emplace_back(port()).send(head + body));
  }
  ASSERT_TRUE(comes_true([&] { return server_->state().requests_waiting == kClients; }));
  // A decoder of gzip has 64 KiB for what it inflates, and one of zstd 8 MiB.
  EXPECT_LT(testing::heap_bytes() - before, kClients * 30'000);
}

TEST_F(HttpServerTest, a_response_that_is_not_read_keeps_no_buffer_of_its_requests_body) {
  constexpr int kClients = 32;
  constexpr int64_t kFileBytes = int64_t{64} << 20;  // more than the buffers of both sockets hold
  const testing::TemporaryDir dir;
  std::ofstream(dir.path() / "file").close();
  std::filesystem::resize_file(dir.path() / "file", static_cast<uintmax_t>(kFileBytes));
  on("POST", "/file", [&](Request&) {
    return TextBody{1 << 20, [&](Request&, const std::string&) {
                      Response response;
                      response.body = FileBody{dir.path() / "file", 0, kFileBytes};
                      return response;
                    }};
  });
  start();
  const std::string body(60'000, 'b');
  const std::string head =
      "POST /file HTTP/1.1\r\nHost: h\r\nContent-Length: " + std::to_string(body.size()) +
      "\r\n\r\n";
  std::vector<HttpClient> clients;
  const int64_t before = testing::heap_bytes();
  for (int i = 0; i < kClients; ++i) {
    ASSERT_TRUE(clients.emplace_back(port()).send(head + body));
  }
  for (const HttpClient& client : clients) ASSERT_TRUE(client.readable(kPatienceSeconds));
  EXPECT_TRUE(
      comes_true([&] { return testing::heap_bytes() - before < kClients * std::ssize(body) / 3; }));
  server_->stop(0);  // before its file goes
}

}  // namespace
}  // namespace voxeld::http
