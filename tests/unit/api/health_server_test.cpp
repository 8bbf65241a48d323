#include "server/api/health_server.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <stdexcept>
#include <thread>

#include "tests/unit/http/http_client.h"

namespace voxeld::api {
namespace {

using testing::HttpClient;
using testing::HttpResponse;

class HealthServerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto server = start_health_server({"127.0.0.1:0", 64, {"/livez", "/readyz"}},
                                      [this](const Head& head) { return respond(head); });
    ASSERT_TRUE(server) << server.error().message();
    server_ = *std::move(server);
  }
  void TearDown() override {
    if (server_) server_->stop();
  }
  Response respond(const Head& head) {
    ++calls_;
    const auto origin = head.headers.find("Origin");
    if (head.path == "/readyz") {
      origin_ = origin == head.headers.end() ? "none" : origin->second;
      return slow_();
    }
    return Response::text(200, "ok\n");
  }
  HttpResponse ask(const std::string& request) {
    HttpClient client(server_->port());
    EXPECT_TRUE(client.send(request));
    return client.receive().value_or(HttpResponse{});
  }
  HttpResponse livez(const std::string& method = "GET", const std::string& lines = "") {
    return ask(method + " /livez HTTP/1.1\r\nHost: localhost\r\n" + lines + "\r\n");
  }

  std::function<Response()> slow_ = [] { return Response::text(200, "ready\n"); };
  std::string origin_;  // of the last request of /readyz
  std::atomic<int> calls_{0};
  std::unique_ptr<HealthServer> server_;
};

TEST_F(HealthServerTest, gets_are_passed_to_the_handler_and_the_connection_is_closed) {
  const HttpResponse response = livez();
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(response.body, "ok\n");
  EXPECT_EQ(response.header("connection"), "close");
  EXPECT_FALSE(response.header("date").empty());
  EXPECT_EQ(calls_, 1);
}

TEST_F(HealthServerTest, other_paths_and_methods_never_come_to_the_handler) {
  EXPECT_EQ(ask("GET /v1/jobs HTTP/1.1\r\nHost: localhost\r\n\r\n").status, 404);
  const HttpResponse posted = livez("POST", "Content-Length: 5\r\n");
  EXPECT_EQ(posted.status, 405);
  EXPECT_EQ(posted.header("allow"), "GET, HEAD, OPTIONS");
  EXPECT_EQ(posted.header("content-type"), "application/problem+json");
  EXPECT_EQ(livez("OPTIONS").status, 204);
  EXPECT_EQ(ask("BROKEN\r\n\r\n").status, 400);
  EXPECT_EQ(ask("GET /livez HTTP/1.1\r\nHost: a b\r\n\r\n").status, 400);
  EXPECT_EQ(calls_, 0);
}

TEST_F(HealthServerTest, the_handler_sees_headers_as_they_were_sent) {
  slow_ = [this] { return Response::text(200, origin_); };
  const auto origin = [&](const std::string& lines) {
    return ask("GET /readyz HTTP/1.1\r\nHost: localhost\r\n" + lines + "\r\n").body;
  };
  EXPECT_EQ(origin(""), "none");
  EXPECT_EQ(origin("Origin:\r\n"), "");
  EXPECT_EQ(origin("origin: \thttp://a%20b \r\n"), "http://a%20b");
  EXPECT_EQ(origin("Origin: a\r\nORIGIN: b\r\n"), "a, b");
}

TEST_F(HealthServerTest, a_body_is_not_read_and_the_response_arrives) {
  EXPECT_EQ(livez("GET", "Content-Length: 100000000\r\n\r\n" + std::string(300'000, 'x')).body,
            "ok\n");
  EXPECT_EQ(livez("GET", "Transfer-Encoding: chunked\r\n").body, "ok\n");
}

TEST_F(HealthServerTest, ranges_are_not_honoured) {
  std::string ranges = "Range: bytes=0-";
  for (int i = 0; i < 1000; ++i) ranges += ",0-";
  const HttpResponse response = livez("GET", ranges + "\r\n");
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(response.body, "ok\n");
}

TEST_F(HealthServerTest, a_head_over_the_limit_is_refused_with_and_without_its_end) {
  std::string lines;
  while (lines.size() <= kHealthHeadBytesMax) lines += "X: y\r\n";
  EXPECT_EQ(livez("GET", lines).status, 431);
  EXPECT_EQ(ask("GET /" + std::string(kHealthHeadBytesMax, 'a')).status, 431);
  EXPECT_EQ(calls_, 0);
}

TEST_F(HealthServerTest, many_silent_connections_delay_no_other) {
  std::vector<std::unique_ptr<HttpClient>> crowd;
  for (int i = 0; i < 300; ++i) {
    crowd.push_back(std::make_unique<HttpClient>(server_->port()));
    ASSERT_TRUE(crowd.back()->send("GET /livez HT"));
  }
  EXPECT_EQ(livez().status, 200);
}

TEST_F(HealthServerTest, a_head_that_does_not_come_ends_the_connection) {
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(ask("GET /livez HT").status, 0);
  EXPECT_GE(std::chrono::steady_clock::now() - begin, kHealthHeadTime);
}

TEST_F(HealthServerTest, a_handler_that_hangs_does_not_delay_livez) {
  std::promise<void> gate, begun;
  slow_ = [&] {
    begun.set_value();
    gate.get_future().wait();
    return Response::text(200, "late\n");
  };
  HttpClient late(server_->port());
  ASSERT_TRUE(late.send("GET /readyz HTTP/1.1\r\nHost: localhost\r\n\r\n"));
  begun.get_future().wait();
  for (int i = 0; i < 20; ++i) EXPECT_EQ(livez().status, 200) << i;
  gate.set_value();
  EXPECT_EQ(late.receive().value_or(HttpResponse{}).body, "late\n");
}

TEST_F(HealthServerTest, an_exception_of_the_handler_is_reported_without_its_text) {
  slow_ = []() -> Response { throw std::runtime_error("secret"); };
  const HttpResponse response = ask("GET /readyz HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_EQ(response.status, 500);
  EXPECT_EQ(response.body, "it failed\n");
  EXPECT_EQ(response.body.find("secret"), std::string::npos);
  for (const auto& [name, value] : response.headers) EXPECT_EQ(value.find("secret"), value.npos);
  EXPECT_EQ(livez().status, 200);
}

TEST_F(HealthServerTest, stopping_closes_the_connections_of_clients_that_wait) {
  HttpClient silent(server_->port());
  ASSERT_TRUE(silent.send("GET /livez HT"));
  EXPECT_EQ(livez().status, 200);
  server_->stop();
  EXPECT_FALSE(silent.receive().has_value());
}

TEST(HealthServer, an_address_in_use_is_an_error) {
  auto first = start_health_server({"127.0.0.1:0", 4, {}}, [](const Head&) { return Response(); });
  ASSERT_TRUE(first);
  const std::string address = "127.0.0.1:" + std::to_string((*first)->port());
  const auto second = start_health_server({address, 4, {}}, [](const Head&) { return Response(); });
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().detail, address + ": Address already in use");
}

}  // namespace
}  // namespace voxeld::api
