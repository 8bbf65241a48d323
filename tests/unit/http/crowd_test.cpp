// Many clients and few threads: clients that wait hold none.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <latch>
#include <string>
#include <thread>
#include <vector>

#include "tests/unit/http/http_server_fixture.h"

namespace voxeld::http {
namespace {

constexpr size_t kLargeBodyBytes = size_t{64} << 20;  // more than the buffers of both sockets hold

class CrowdTest : public HttpServerTest {
 protected:
  CrowdTest() {
    on("GET", "/large",
       [](Request&) { return Response::text(200, std::string(kLargeBodyBytes, 'x')); });
  }
};

TEST_F(CrowdTest, idle_and_slow_connections_hold_no_thread) {
  start(/*threads=*/1);
  std::vector<HttpClient> clients;
  // Once more where the test stood still until the server has closed those with half a head.
  ASSERT_TRUE(comes_true([&] {
    clients.clear();
    for (int i = 0; i < 150; ++i) {
      clients.emplace_back(port());
      const std::string beginnings[] = {
          "", "GET /hello HTTP/1.1\r\nHos",
          "POST /echo HTTP/1.1\r\nHost: h\r\nContent-Length: 9\r\n\r\nab"};
      if (!clients.back().send(beginnings[i % 3])) return false;
    }
    while (server_->state().connections != 150) {
      if (clients[1].readable(0.002)) return false;  // the first of them
    }
    return true;
  }));
  EXPECT_EQ(get("/hello").body, "hello");
  ASSERT_TRUE(clients[2].send("cdefghi"));
  EXPECT_EQ(clients[2].receive().value_or(HttpResponse{}).body, "abcdefghi");
}

TEST_F(CrowdTest, a_slow_reader_holds_no_thread_and_gets_everything) {
  start(/*threads=*/1);
  HttpClient slow(port());
  ASSERT_TRUE(slow.send_get("/large"));
  ASSERT_TRUE(comes_true([&] { return server_->state().requests_running == 0; }));
  EXPECT_EQ(get("/hello").body, "hello");
  const auto response = slow.receive();
  ASSERT_TRUE(response);
  EXPECT_EQ(response->body.size(), kLargeBodyBytes);
  ASSERT_TRUE(slow.send_get("/hello"));
  EXPECT_EQ(slow.receive().value_or(HttpResponse{}).body, "hello");
  const auto seen = observed(3);
  EXPECT_EQ(seen[1].path, "/large");
  EXPECT_EQ(seen[1].bytes_out, static_cast<int64_t>(kLargeBodyBytes));
}

TEST_F(CrowdTest, a_pipelining_client_queues_behind_others_after_each_response) {
  std::latch held{1};
  std::atomic<bool> has_entered{false};
  on("GET", "/held", [&](Request&) {
    has_entered = true;
    held.wait();
    return Response::text(200, "held");
  });
  on("GET", "/other", [](Request&) { return Response::text(200, "other"); });
  start(/*threads=*/1);
  constexpr int kPipelined = 200;
  std::string text = "GET /held HTTP/1.1\r\nHost: h\r\n\r\n";
  for (int i = 0; i < kPipelined; ++i) text += "GET /hello HTTP/1.1\r\nHost: h\r\n\r\n";
  HttpClient greedy(port()), other(port());
  ASSERT_TRUE(greedy.send(text));
  // Both are with the server when the first response goes out.
  ASSERT_TRUE(comes_true([&] { return has_entered && server_->state().connections == 2; }));
  ASSERT_TRUE(other.send_get("/other"));
  held.count_down();
  EXPECT_EQ(other.receive().value_or(HttpResponse{}).body, "other");
  EXPECT_EQ(greedy.receive().value_or(HttpResponse{}).body, "held");
  for (int i = 0; i < kPipelined; ++i) {
    ASSERT_EQ(greedy.receive().value_or(HttpResponse{}).body, "hello") << i;
  }
  const auto seen = observed(kPipelined + 2);
  const auto at = std::ranges::find(seen, "/other", &Observed::path) - seen.begin();
  EXPECT_LE(at, 2) << "behind what runs and at most one more of the other's";
}

TEST_F(CrowdTest, requests_pipelined_before_a_client_shuts_its_side_get_responses) {
  start(/*threads=*/2);
  HttpClient client(port());
  ASSERT_TRUE(
      client.send("GET /hello HTTP/1.1\r\nHost: h\r\n\r\nGET /hello HTTP/1.1\r\nHost: h\r\n\r\n"
                  "GET /hello HTTP/1.1\r\nHost: h\r\n\r\n"));
  client.finish_sending();
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(client.receive().value_or(HttpResponse{}).body, "hello") << i;
  }
  EXPECT_EQ(client.receive_to_end(), "");
}

TEST_F(CrowdTest, uploads_that_stand_still_hold_no_thread) {
  start(/*threads=*/1);
  std::vector<HttpClient> clients;
  for (int i = 0; i < 40; ++i) {
    clients.emplace_back(port());
    ASSERT_TRUE(clients.back().send(
        "POST /echo HTTP/1.1\r\nHost: h\r\nTransfer-Encoding: chunked\r\n\r\n1\r\na\r\n"));
  }
  EXPECT_EQ(get("/hello").body, "hello");
  for (HttpClient& client : clients) ASSERT_TRUE(client.send("0\r\n\r\n"));
  for (HttpClient& client : clients) {
    EXPECT_EQ(client.receive().value_or(HttpResponse{}).body, "a");
  }
}

TEST_F(CrowdTest, requests_that_wait_hold_no_thread) {
  start(/*threads=*/1);
  std::vector<HttpClient> clients;
  for (int i = 0; i < 100; ++i) {
    clients.emplace_back(port());
    ASSERT_TRUE(clients.back().send_get("/endless"));
  }
  ASSERT_TRUE(comes_true([&] { return server_->state().requests_waiting == 100; }));
  EXPECT_EQ(server_->state().requests_running, 0);
  EXPECT_EQ(get("/hello").body, "hello");
  waits_.ends = true;
  wake_all();
  for (HttpClient& client : clients) {
    EXPECT_EQ(client.receive().value_or(HttpResponse{}).body, "ended");
  }
  EXPECT_EQ(server_->state().requests_waiting, 0);
}

TEST_F(CrowdTest, the_longest_idle_connection_is_closed_when_all_places_are_taken) {
  start(2, /*connections_max=*/2);
  HttpClient first(port());
  ASSERT_TRUE(first.send_get("/hello") && first.receive());
  // It becomes idle a moment after its response has arrived.
  ASSERT_TRUE(comes_true([&] { return server_->requests_in_flight() == 0; }));
  HttpClient second(port());
  ASSERT_TRUE(second.send_get("/hello") && second.receive());
  // At first no connection has been idle for long enough.
  ASSERT_TRUE(comes_true([&] {
    HttpClient third(port());
    return third.send_get("/hello") && third.receive().has_value();
  }));
  EXPECT_EQ(first.receive_to_end(), "");
  ASSERT_TRUE(second.send_get("/hello"));
  EXPECT_TRUE(second.receive());
}

TEST_F(CrowdTest,
       a_connection_with_half_a_head_is_closed_when_all_places_are_taken_and_none_is_idle) {
  start(2, /*connections_max=*/1);
  HttpClient half(port());
  ASSERT_TRUE(half.send("GET /hello HTTP/1.1\r\n"));
  ASSERT_TRUE(comes_true([&] {
    HttpClient other(port());
    return other.send_get("/hello") && other.receive().has_value();
  }));
  EXPECT_EQ(half.receive_to_end(), "");
}

TEST_F(CrowdTest, loopback_and_trusted_proxies_have_no_cap_by_address) {
  HttpServerConfig config;
  config.connections_per_address = 1;
  start_with(config);
  HttpClient first(port()), second(port());
  ASSERT_TRUE(first.send_get("/hello") && second.send_get("/hello"));
  EXPECT_TRUE(first.receive() && second.receive());
}

TEST_F(CrowdTest, address_headers_are_trusted_only_from_trusted_proxies) {
  on("GET", "/headers", [](Request& request) {
    std::string names;
    for (const auto& [name, value] : request.head.headers) names += name + " ";
    return Response::text(200, names);
  });
  const std::string lines =
      "X-Forwarded-For: 6.6.6.6\r\nX-Real-IP: 6.6.6.6\r\nForwarded: for=6.6.6.6\r\n";
  start();
  EXPECT_EQ(get("/headers", lines).body, "Host ");
  EXPECT_EQ(observed(1)[0].peer, "127.0.0.1");
  server_->stop(0);
  HttpServerConfig config;
  config.trusted_proxies = {"127.0.0.1"};
  start_with(config);
  EXPECT_EQ(get("/headers", lines).body, "Host ");
  EXPECT_EQ(observed(2)[1].peer, "6.6.6.6");
}

TEST_F(CrowdTest, a_download_that_runs_is_sent_to_its_end_when_the_server_stops) {
  start(/*threads=*/1);
  HttpClient client(port());
  ASSERT_TRUE(client.send_get("/large"));
  const auto head = client.receive_head();
  ASSERT_TRUE(head);
  std::thread stopper([&] { server_->stop(kPatienceSeconds); });
  size_t bytes = 0;
  for (std::string some = client.receive_some(); !some.empty(); some = client.receive_some()) {
    bytes += some.size();
  }
  stopper.join();
  EXPECT_EQ(bytes, kLargeBodyBytes);
}

}  // namespace
}  // namespace voxeld::http
