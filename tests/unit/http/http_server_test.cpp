// Exchanges over real sockets: framing, persistent connections and refusals.
#include "server/http/http_server.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <thread>

#include "server/http/message/head_parser.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/http/http_server_fixture.h"

namespace voxeld::http {
namespace {

std::string post(const std::string& target, const std::string& body) {
  return "POST " + target +
         " HTTP/1.1\r\nHost: h\r\nContent-Length: " + std::to_string(body.size()) + "\r\n\r\n" +
         body;
}

TEST_F(HttpServerTest, a_response_has_its_length_and_an_id_and_leaves_the_connection_open) {
  start();
  const HttpResponse response = get("/hello");
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(response.body, "hello");
  EXPECT_EQ(response.header("content-length"), "5");
  EXPECT_EQ(response.header("connection"), "keep-alive");
  EXPECT_EQ(response.header("x-content-type-options"), "nosniff");
  EXPECT_EQ(response.header("x-request-id").substr(0, 2), "r-");
}

TEST_F(HttpServerTest, a_connection_serves_many_requests) {
  start();
  HttpClient client(port());
  for (int i = 0; i < 100; ++i) {
    const std::string body = "body " + std::to_string(i);
    ASSERT_TRUE(client.send(post("/echo", body)));
    const auto response = client.receive();
    ASSERT_TRUE(response) << i;
    EXPECT_EQ(response->body, body);
  }
  EXPECT_EQ(server_->state().connections, 1);
}

TEST_F(HttpServerTest, pipelined_requests_get_responses_in_order) {
  start();
  HttpClient client(port());
  std::string all;
  for (int i = 0; i < 50; ++i) {
    all += i % 2 == 0 ? post("/echo", std::to_string(i)) : "GET /hello HTTP/1.1\r\nHost: h\r\n\r\n";
  }
  ASSERT_TRUE(client.send(all));
  for (int i = 0; i < 50; ++i) {
    const auto response = client.receive();
    ASSERT_TRUE(response) << i;
    EXPECT_EQ(response->body, i % 2 == 0 ? std::to_string(i) : "hello");
  }
}

TEST_F(HttpServerTest, a_pipelined_chunked_body_is_followed_by_the_next_request) {
  start();
  HttpClient client(port());
  ASSERT_TRUE(
      client.send("POST /echo HTTP/1.1\r\nHost: h\r\nTransfer-Encoding: chunked\r\n\r\n"
                  "2\r\nab\r\n1\r\nc\r\n0\r\nT: x\r\n\r\nGET /hello HTTP/1.1\r\nHost: h\r\n\r\n"));
  EXPECT_EQ(client.receive()->body, "abc");
  EXPECT_EQ(client.receive()->body, "hello");
}

TEST_F(HttpServerTest, a_request_is_the_same_at_every_split) {
  start();
  HttpClient client(port());
  const std::string text =
      "POST /echo HTTP/1.1\r\nHost: h\r\nTransfer-Encoding: chunked\r\n\r\n"
      "2\r\nab\r\n1;x=y\r\nc\r\n0\r\n\r\n";
  for (size_t at = 1; at < text.size(); ++at) {
    ASSERT_TRUE(client.send(text.substr(0, at)) && client.send(text.substr(at)));
    const auto response = client.receive();
    ASSERT_TRUE(response) << "split at " << at;
    EXPECT_EQ(response->body, "abc") << "split at " << at;
  }
  for (const char c : text) ASSERT_TRUE(client.send(std::string(1, c)));
  EXPECT_EQ(client.receive()->body, "abc");
}

TEST_F(HttpServerTest, a_truncated_head_runs_no_handler) {
  start();
  const std::string head = "GET /hello HTTP/1.1\r\nHost: h\r\n\r\n";
  for (size_t bytes = 0; bytes < head.size(); ++bytes) {
    HttpClient client(port());
    ASSERT_TRUE(client.send(head.substr(0, bytes)));
    client.finish_sending();
    EXPECT_EQ(client.receive_to_end(), "") << bytes;
  }
  get("/hello");
  EXPECT_EQ(observed(1).size(), 1u);
}

TEST_F(HttpServerTest, connections_close_when_the_client_says_so_or_speaks_1_0) {
  start();
  for (const char* text : {"GET /hello HTTP/1.1\r\nHost: h\r\nConnection: close\r\n\r\n",
                           "GET /hello HTTP/1.0\r\n\r\n"}) {
    HttpClient client(port());
    ASSERT_TRUE(client.send(text));
    const auto response = client.receive();
    ASSERT_TRUE(response);
    EXPECT_EQ(response->header("connection"), "close");
    EXPECT_EQ(client.receive_to_end(), "");
  }
}

TEST_F(HttpServerTest, head_gets_the_same_head_without_the_body_and_the_connection_goes_on) {
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send("HEAD /hello HTTP/1.1\r\nHost: h\r\n\r\n"));
  const auto head = client.receive(/*has_body=*/false);
  ASSERT_TRUE(head);
  EXPECT_EQ(head->status, 200);
  EXPECT_EQ(head->header("content-length"), "5");
  ASSERT_TRUE(client.send_get("/hello"));
  EXPECT_EQ(client.receive()->body, "hello");
}

TEST_F(HttpServerTest, a_broken_head_is_a_bad_request_and_closes) {
  start();
  for (const char* text : {"GET / HTTP/1.1\r\n\r\n", "GET / HTTP/1.1\nHost: h\n\n", "\r\n\r\n",
                           "POST /echo HTTP/1.1\r\nHost: h\r\nContent-Length: 1\r\n"
                           "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n"}) {
    HttpClient client(port());
    ASSERT_TRUE(client.send(text));
    const auto response = client.receive();
    ASSERT_TRUE(response) << text;
    EXPECT_EQ(response->status, 400);
    EXPECT_EQ(response->code(), "bad-request");
    EXPECT_EQ(response->header("connection"), "close");
    EXPECT_NE(response->header("x-request-id"), "");
    EXPECT_EQ(client.receive_to_end(), "");
  }
}

TEST_F(HttpServerTest, a_head_over_the_limit_is_refused_with_and_without_its_end) {
  start();
  const std::string start_of_head = "GET /hello HTTP/1.1\r\nHost: h\r\n";
  // Many lines are another limit: lines of 4000 bytes.
  const auto filled = [&](size_t bytes) {
    std::string head = start_of_head;
    while (head.size() + 10 < bytes) {
      head += "X: " + std::string(std::min<size_t>(4000, bytes - head.size() - 5), 'a') + "\r\n";
    }
    return head;
  };
  HttpClient fits(port());
  ASSERT_TRUE(fits.send(filled(kHeadBytesMax - 20) + "\r\n"));
  EXPECT_EQ(fits.receive()->status, 200);
  for (const char* end : {"\r\n", ""}) {
    HttpClient client(port());
    ASSERT_TRUE(client.send(filled(kHeadBytesMax + 10) + end));
    const auto response = client.receive();
    ASSERT_TRUE(response);
    EXPECT_EQ(response->status, 400);
    EXPECT_EQ(response->detail(), "the head of the request is too long");
  }
}

TEST_F(HttpServerTest, an_unread_body_closes_the_connection_but_not_before_the_response_arrived) {
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send(post("/ignore", std::string(3'000'000, 'x'))));
  const auto response = client.receive();
  ASSERT_TRUE(response);
  EXPECT_EQ(response->body, "ignored");
  EXPECT_EQ(response->header("connection"), "close");
  EXPECT_EQ(client.receive_to_end(), "");
}

TEST_F(HttpServerTest, a_body_over_the_limit_is_payload_too_large) {
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send("POST /echo HTTP/1.1\r\nHost: h\r\nContent-Length: 1048577\r\n\r\n"));
  const auto response = client.receive();
  ASSERT_TRUE(response);
  EXPECT_EQ(response->status, 413);
  EXPECT_EQ(response->code(), "payload-too-large");
}

TEST_F(HttpServerTest, a_client_that_waits_for_100_gets_it_and_then_its_response) {
  start();
  HttpClient client(port());
  ASSERT_TRUE(
      client.send("POST /echo HTTP/1.1\r\nHost: h\r\nContent-Length: 3\r\n"
                  "Expect: 100-continue\r\n\r\n"));
  EXPECT_EQ(client.receive_some().substr(0, 21), "HTTP/1.1 100 Continue");
  ASSERT_TRUE(client.send("abc"));
  EXPECT_EQ(client.receive()->body, "abc");
}

TEST_F(HttpServerTest, a_client_that_sent_its_body_or_speaks_1_0_is_not_told_to_continue) {
  start();
  for (const char* version : {"1.1", "1.0"}) {
    HttpClient client(port());
    ASSERT_TRUE(client.send("POST /echo HTTP/" + std::string(version) +
                            "\r\nHost: h\r\nContent-Length: 3\r\nExpect: 100-continue\r\n\r\nabc"));
    EXPECT_TRUE(client.receive_some().starts_with("HTTP/1.1 200 ")) << version;
  }
}

TEST_F(HttpServerTest, a_client_whose_body_is_too_large_is_not_told_to_continue) {
  start();
  HttpClient client(port());
  ASSERT_TRUE(
      client.send("POST /echo HTTP/1.1\r\nHost: h\r\nContent-Length: 1048577\r\n"
                  "Expect: 100-continue\r\n\r\n"));
  EXPECT_TRUE(client.receive_some().starts_with("HTTP/1.1 413 "));
}

TEST_F(HttpServerTest, bodies_that_end_early_are_a_bad_request) {
  start();
  for (const char* head : {"Content-Length: 6\r\n\r\nhello",
                           "Transfer-Encoding: chunked\r\n\r\n5\r\nhello\r\n0\r\n"}) {
    HttpClient client(port());
    ASSERT_TRUE(client.send("POST /echo HTTP/1.1\r\nHost: h\r\n" + std::string(head)));
    client.finish_sending();
    const HttpResponse response = client.receive().value_or(HttpResponse{});
    EXPECT_EQ(response.status, 400);
    EXPECT_EQ(response.detail(), "the body ends early");
    EXPECT_EQ(response.header("connection"), "close");
  }
}

TEST_F(HttpServerTest, a_body_larger_than_every_buffer_arrives_whole) {
  start();
  std::string body;
  for (int i = 0; i < 1 << 20; ++i) body += static_cast<char>('a' + i % 23);
  HttpClient client(port());
  ASSERT_TRUE(client.send(post("/echo", body)));
  EXPECT_TRUE(client.receive().value_or(HttpResponse{}).body == body);
}

TEST_F(HttpServerTest, plain_request_ids_are_returned_and_others_replaced) {
  start();
  EXPECT_EQ(get("/hello", "X-Request-Id: a.B-9_\r\n").header("x-request-id"), "a.B-9_");
  for (const std::string& id : {std::string("a b"), std::string("a\"b"), std::string(65, 'a')}) {
    const std::string given = get("/hello", "X-Request-Id: " + id + "\r\n").header("x-request-id");
    EXPECT_EQ(given.size(), 18u);
    EXPECT_NE(given, id);
  }
  // In whatever order: an exchange of another connection may be observed before this one.
  const auto exchanges = observed(4);
  EXPECT_EQ(std::count_if(exchanges.begin(), exchanges.end(),
                          [](const auto& one) { return one.request_id == "a.B-9_"; }),
            1);
}

TEST_F(HttpServerTest, an_exception_of_a_handler_is_an_internal_error_and_the_next_request_works) {
  on("GET", "/throw", [](Request&) -> Reply { throw std::runtime_error("oh no"); });
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send_get("/throw"));
  const auto response = client.receive();
  ASSERT_TRUE(response);
  EXPECT_EQ(response->status, 500);
  EXPECT_EQ(response->code(), "internal");
  EXPECT_NE(response->detail().find("unexpected failure"), std::string::npos);
  EXPECT_EQ(response->body.find("oh no"), std::string::npos);
  for (const auto& [name, value] : response->headers)
    EXPECT_EQ(value.find("oh no"), std::string::npos);
  ASSERT_TRUE(client.send_get("/hello"));
  EXPECT_EQ(client.receive()->status, 200);
}

TEST_F(HttpServerTest, the_observer_sees_every_exchange) {
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send(post("/echo", "abcd") + "BROKEN\r\n\r\n"));
  client.receive();
  client.receive();
  const auto all = observed(2);
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].method, "POST");
  EXPECT_EQ(all[0].path, "/echo");
  EXPECT_EQ(all[0].peer, "127.0.0.1");
  EXPECT_EQ(all[0].status, 200);
  EXPECT_EQ(all[0].bytes_in, 4);
  EXPECT_EQ(all[0].bytes_out, 4);
  EXPECT_EQ(all[1].method, "");
  EXPECT_EQ(all[1].status, 400);
}

TEST_F(HttpServerTest, header_values_of_a_response_cannot_break_out_of_their_line) {
  on("GET", "/inject", [](Request& request) {
    Response response = Response::text(200, "");
    response.headers["X-Name"] = "a\r\nX-Evil: " + request.query("x").value_or("");
    return response;
  });
  start();
  const HttpResponse response = get("/inject?x=1");
  EXPECT_EQ(response.header("x-name"), "a??X-Evil: 1");
  EXPECT_EQ(response.header("x-evil"), "");
}

TEST_F(HttpServerTest, a_large_response_arrives_whole) {
  const std::string body(20'000'000, 'b');
  on("GET", "/large", [&](Request&) { return Response::text(200, body); });
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send_get("/large"));
  const auto response = client.receive();
  ASSERT_TRUE(response);
  EXPECT_TRUE(response->body == body);
}

TEST_F(HttpServerTest, a_part_of_a_file_is_sent_from_its_offset) {
  const testing::TemporaryDir dir;
  const std::string text = "0123456789";
  ASSERT_TRUE(write_file(dir.path() / "f",
                         std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size())));
  on("GET", "/file", [&](Request&) {
    Response response;
    response.body = FileBody{dir.path() / "f", 3, 4};
    return response;
  });
  start();
  EXPECT_EQ(get("/file").body, "3456");
  EXPECT_EQ(observed(1)[0].bytes_out, 4);
}

TEST_F(HttpServerTest, a_file_that_vanished_or_shrank_closes_the_connection_mid_response) {
  const testing::TemporaryDir dir;
  ASSERT_TRUE(write_file(dir.path() / "short", std::array<uint8_t, 2>{'a', 'b'}));
  for (const char* name : {"short", "vanished"}) {
    on("GET", std::string("/") + name, [&dir, name](Request&) {
      Response response;
      response.body = FileBody{dir.path() / name, 0, 4};
      return response;
    });
  }
  start();
  for (const auto& [name, rest] : {std::pair("/short", "ab"), std::pair("/vanished", "")}) {
    HttpClient client(port());
    ASSERT_TRUE(client.send_get(name));
    ASSERT_TRUE(client.send_get(name));
    const auto head = client.receive_head();
    ASSERT_TRUE(head);
    EXPECT_EQ(head->header("content-length"), "4");
    EXPECT_EQ(client.receive_to_end(), rest) << name;
  }
}

TEST_F(HttpServerTest, a_wait_is_abandoned_when_its_client_leaves) {
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send_get("/endless"));
  ASSERT_TRUE(comes_true([&] { return server_->state().requests_waiting == 1; }));
  ASSERT_TRUE(client.send("GET /hello HTTP/1.1\r\n")) << "bytes that nobody reads meanwhile";
  client.close();
  EXPECT_TRUE(comes_true([&] { return waits_.abandoned == 1; }));
  EXPECT_EQ(observed(1)[0].status, kClientClosedStatus);
  EXPECT_TRUE(comes_true([&] { return server_->state().connections == 0; }));
  wake_all();  // of a request that has ended
}

TEST_F(HttpServerTest, connections_over_the_limit_are_closed_at_once_and_room_is_used_again) {
  start(2, /*connections_max=*/2);
  HttpClient first(port()), second(port());
  // Idle ones would make room after a second.
  ASSERT_TRUE(first.send_get("/endless") && second.send_get("/endless"));
  ASSERT_TRUE(comes_true([&] { return server_->state().requests_waiting == 2; }));
  HttpClient third(port());
  EXPECT_EQ(third.receive_to_end(), "");
  first.close();
  ASSERT_TRUE(comes_true([&] { return server_->state().connections == 1; }));
  HttpClient fourth(port());
  ASSERT_TRUE(fourth.send_get("/hello"));
  EXPECT_TRUE(fourth.receive());
}

TEST_F(HttpServerTest, many_clients_on_many_connections_get_their_own_responses) {
  start(/*threads=*/8);
  constexpr int kThreads = 8, kConnections = 10, kRequests = 20;
  std::atomic<int> right{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      std::vector<HttpClient> clients;
      for (int c = 0; c < kConnections; ++c) clients.emplace_back(port());
      for (int r = 0; r < kRequests; ++r) {
        const auto body = [&](int c) {
          return std::to_string(t) + "/" + std::to_string(c) + "/" + std::to_string(r);
        };
        for (int c = 0; c < kConnections; ++c) clients[c].send(post("/echo", body(c)));
        for (int c = 0; c < kConnections; ++c) {
          const auto response = clients[c].receive();
          if (response && response->body == body(c)) ++right;
        }
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(right, kThreads * kConnections * kRequests);
  EXPECT_TRUE(comes_true([&] { return server_->state().connections == 0; }));
  EXPECT_EQ(observed(right).size(), static_cast<size_t>(right));
}

TEST(StartFront, says_why_it_cannot_listen) {
  const auto handler = [](Request&) { return Response(); };
  const auto observer = [](const ExchangeRecord&) {};
  auto first = start_http_server({"127.0.0.1:0", 1, 1}, handler, observer);
  ASSERT_TRUE(first);
  const std::string address = "127.0.0.1:" + std::to_string((*first)->port());
  const auto second = start_http_server({address, 1, 1}, handler, observer);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().message(), address + ": Address already in use");
  const auto portless = start_http_server({"localhost", 1, 1}, handler, observer);
  ASSERT_FALSE(portless);
  EXPECT_EQ(portless.error().message(), "listen address: expected HOST:PORT, got \"localhost\"");
}

}  // namespace
}  // namespace voxeld::http
