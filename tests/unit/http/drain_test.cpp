// How a server ends: running and waiting requests are served, late ones are cut, nothing hangs.
#include <gtest/gtest.h>

#include <chrono>
#include <latch>
#include <string>
#include <thread>

#include "tests/unit/http/http_server_fixture.h"

namespace voxeld::http {
namespace {

class DrainTest : public HttpServerTest {
 protected:
  DrainTest() {
    on("GET", "/held", [this](Request&) {
      ++entered_;
      held_.wait();
      return Response::text(200, "held");
    });
  }
  // Returns when everything that was sent before has reached the server: connections accepted after
  // that come from a later wait for events.
  void settle() {
    for (int i = 0; i < 2; ++i) {
      const int64_t before = server_->state().connections;
      fillers_.emplace_back(port());
      ASSERT_TRUE(comes_true([&] { return server_->state().connections > before; }));
    }
  }
  // With POST as new work.
  void start_refusing(int threads) {
    HttpServerConfig config;
    config.threads = threads;
    config.is_new_work = [](const Head& head) { return head.method == "POST"; };
    start_with(config);
  }
  // For stop() that ends before: a test that waits for it hangs.
  static constexpr int kLongGraceSeconds = 3600;
  // Stops while `work` runs, which has to end by itself: one request is held all that time.
  template <typename Work>
  void while_draining(const Work& work) {
    HttpClient running(port());
    ASSERT_TRUE(running.send_get("/held"));
    ASSERT_TRUE(comes_true([&] { return entered_ == 1; }));
    std::thread stopper([&] { server_->stop(kLongGraceSeconds); });
    // `Connection: close` shows that the server has begun to drain.
    EXPECT_TRUE(comes_true([&] { return get("/hello").header("connection") == "close"; }));
    work();
    held_.count_down();
    EXPECT_EQ(running.receive().value_or(HttpResponse{}).body, "held");
    running.close();
    stopper.join();
  }
  static void expect_refused(const HttpResponse& response) {
    EXPECT_EQ(response.status, 503);
    EXPECT_EQ(response.code(), "shutting-down");
    EXPECT_EQ(response.header("content-type"), "application/problem+json");
    EXPECT_EQ(response.header("retry-after"), "2");
    EXPECT_EQ(response.header("connection"), "close");
  }

  std::latch held_{1};
  std::atomic<int> entered_{0};
  std::vector<HttpClient> fillers_;
};

TEST_F(DrainTest, running_and_waiting_requests_are_served_and_then_idle_connections_closed) {
  start(/*threads=*/1);
  HttpClient idle(port()), running(port()), waiting(port()), half(port());
  ASSERT_TRUE(idle.send_get("/hello") && idle.receive());
  ASSERT_TRUE(running.send_get("/held"));
  ASSERT_TRUE(comes_true([&] { return entered_ == 1; }));
  ASSERT_TRUE(waiting.send_get("/hello") && half.send("GET /hello HTTP/1.1\r\n"));
  settle();
  std::thread stopper([&] { server_->stop(kPatienceSeconds); });
  // As its only thread is held, no response tells that it drains.
  ASSERT_TRUE(comes_true([&] { return server_->state().is_draining; }));
  held_.count_down();
  const auto first = running.receive();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->body, "held");
  EXPECT_EQ(first->header("connection"), "close");
  running.close();  // its thread lingers for that
  const auto second = waiting.receive();
  ASSERT_TRUE(second);
  EXPECT_EQ(second->body, "hello");
  EXPECT_EQ(second->header("connection"), "close");
  waiting.close();
  EXPECT_EQ(idle.receive_to_end(), "");
  EXPECT_EQ(half.receive_to_end(), "");
  stopper.join();
  EXPECT_EQ(server_->state().connections, 0);
  EXPECT_EQ(server_->state().requests_running, 0);
}

TEST_F(DrainTest, nobody_is_let_in_any_more) {
  start();
  const int port_before = port();
  server_->stop(0);
  EXPECT_FALSE(HttpClient(port_before).is_open());
}

TEST_F(DrainTest, new_work_is_refused_on_new_and_open_connections_and_other_requests_are_served) {
  start_refusing(/*threads=*/4);
  const std::string work = "POST /echo HTTP/1.1\r\nHost: h\r\nContent-Length: 2\r\n\r\nab";
  HttpClient persistent(port()), reading(port()), half(port());
  ASSERT_TRUE(persistent.send(work) && reading.send_get("/hello") && half.send(work.substr(0, 30)));
  EXPECT_EQ(persistent.receive().value_or(HttpResponse{}).body, "ab");
  EXPECT_EQ(reading.receive().value_or(HttpResponse{}).header("connection"), "keep-alive");
  while_draining([&] {
    ASSERT_TRUE(persistent.send(work) && half.send(work.substr(30)) && reading.send_get("/hello"));
    expect_refused(persistent.receive().value_or(HttpResponse{}));
    EXPECT_EQ(persistent.receive_to_end(), "");
    expect_refused(half.receive().value_or(HttpResponse{}));
    EXPECT_EQ(reading.receive().value_or(HttpResponse{}).body, "hello");
    EXPECT_EQ(reading.receive_to_end(), "");
    HttpClient fresh(port());
    ASSERT_TRUE(fresh.send(work));
    expect_refused(fresh.receive().value_or(HttpResponse{}));
  });
}

TEST_F(DrainTest, a_refused_upload_is_not_asked_for_its_body) {
  start_refusing(/*threads=*/2);
  while_draining([&] {
    for (const std::string expect : {"Expect: 100-continue\r\n", ""}) {
      HttpClient client(port());
      ASSERT_TRUE(client.send("POST /echo HTTP/1.1\r\nHost: h\r\n" + expect +
                              "Content-Length: 1000000\r\n\r\n"));
      EXPECT_TRUE(client.receive_some().starts_with("HTTP/1.1 503 ")) << "and no 100 before it";
    }
  });
}

TEST_F(DrainTest, clients_that_repeat_requests_for_work_do_not_prevent_the_end) {
  start_refusing(/*threads=*/4);
  std::atomic<bool> ended{false};
  std::vector<std::thread> clients;
  for (int i = 0; i < 3; ++i) {
    clients.emplace_back([&] {
      while (!ended) {
        HttpClient client(port());
        if (client.send("POST /ignore HTTP/1.1\r\nHost: h\r\n\r\n")) (void)client.receive();
      }
    });
  }
  while_draining([] {});
  ended = true;
  for (std::thread& client : clients) client.join();
}

TEST_F(DrainTest, requests_that_wait_past_the_grace_are_cut) {
  start(/*threads=*/1);
  HttpClient first(port()), second(port());
  ASSERT_TRUE(first.send_get("/endless") && second.send_get("/endless"));
  ASSERT_TRUE(comes_true([&] { return server_->state().requests_waiting == 2; }));
  const auto begun = Clock::now();
  server_->stop(0.2);
  EXPECT_GE(Clock::now() - begun, std::chrono::milliseconds(200));
  EXPECT_EQ(first.receive_to_end(), "");
  EXPECT_EQ(second.receive_to_end(), "");
  EXPECT_EQ(waits_.abandoned, 0) << "their clients have not left";
  EXPECT_EQ(observed(2)[0].status, kClientClosedStatus);
}

TEST_F(DrainTest, requests_that_wait_look_again_when_draining_begins) {
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send_get("/endless"));
  ASSERT_TRUE(comes_true([&] { return server_->state().requests_waiting == 1; }));
  waits_.ends = true;
  server_->stop(kPatienceSeconds);
  EXPECT_EQ(client.receive().value_or(HttpResponse{}).body, "ended");
}

TEST_F(DrainTest, a_request_that_was_queued_behind_a_stuck_handler_does_not_begin_after_the_end) {
  start(/*threads=*/1);
  HttpClient running(port()), waiting(port());
  ASSERT_TRUE(running.send_get("/held"));
  ASSERT_TRUE(comes_true([&] { return entered_ == 1; }));
  ASSERT_TRUE(waiting.send_get("/held"));
  settle();
  EXPECT_EQ(server_->stop(0.1).size(), 1U);
  held_.count_down();
  server_.reset();
  EXPECT_EQ(entered_, 1);
  EXPECT_TRUE(waiting.readable(kPatienceSeconds)) << "closed";
}

TEST_F(DrainTest, an_upload_that_stands_still_is_cut_at_the_end_of_the_grace) {
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send("POST /echo HTTP/1.1\r\nHost: h\r\nContent-Length: 100000\r\n\r\nabc"));
  ASSERT_TRUE(comes_true([&] { return server_->requests_in_flight() == 1; }));
  server_->stop(0);
  EXPECT_EQ(observed(1)[0].status, kClientClosedStatus) << "not that of a body that is too slow";
}

TEST_F(DrainTest, a_handler_that_minds_nothing_is_named_and_left_behind) {
  start();
  HttpClient stuck(port()), fine(port());
  ASSERT_TRUE(stuck.send_get("/held?a=1") && fine.send_get("/endless"));
  ASSERT_TRUE(comes_true([&] { return entered_ == 1 && waits_.entered == 1; }));
  const std::vector<RunningRequest> left = server_->stop(0.1);
  ASSERT_EQ(left.size(), 1U) << "the other one holds no thread";
  EXPECT_EQ(left[0].what, "GET /held");
  EXPECT_EQ(left[0].peer, "127.0.0.1");
  EXPECT_GE(left[0].seconds, 0.1);
  EXPECT_TRUE(server_->stop(0).empty());
  held_.count_down();
  server_.reset();
}

TEST_F(DrainTest, stopping_under_load_completes_every_response_that_has_begun) {
  start(/*threads=*/4);
  constexpr int kClients = 8;
  std::atomic<int> complete{0}, broken{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < kClients; ++i) {
    threads.emplace_back([&] {
      // Until the connection ends: between two responses, never within one.
      HttpClient client(port());
      while (client.send_get("/hello")) {
        const auto response = client.receive_head();
        if (!response) return;
        std::string body;
        while (body.size() < 5) {
          const std::string more = client.receive_some();
          if (more.empty()) break;
          body += more;
        }
        ++(body == "hello" ? complete : broken);
        if (response->header("connection") == "close") return;
      }
    });
  }
  EXPECT_TRUE(comes_true([&] { return complete > 500; }));
  server_->stop(kPatienceSeconds);
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(broken, 0);
}

TEST_F(DrainTest, stopping_twice_is_stopping_once) {
  start();
  server_->stop(1);
  server_->stop(1);
  server_.reset();
}

}  // namespace
}  // namespace voxeld::http
