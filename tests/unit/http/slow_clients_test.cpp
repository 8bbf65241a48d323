// Clients that hold a connection without using it. They wait for real deadlines (10 and 20 s), so
// all of them run side by side, once, and each test looks at what one of them met.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "server/base/disk/file.h"
#include "server/http/http_server.h"
#include "server/http/message/body_decoder.h"
#include "server/store/held_files.h"
#include "tests/unit/base/comes_true.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/http/http_server_fixture.h"

namespace voxeld::http {
namespace {

constexpr int64_t kLargeBytes = int64_t{64} << 20;  // more than the buffers of both sockets hold
constexpr double kShortStallSeconds = 3;

// How a client fared.
struct Fate {
  double seconds = 0;     // until the server responded or closed
  HttpResponse response;  // status 0: closed without one
  bool is_closed = false;
};

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Sends `first`, then a byte of `filler` every `pause_seconds` (0: nothing) until there is an
// response or an end.
Fate suffer(int port, const std::string& first, const std::string& filler, double pause_seconds) {
  const auto start = Clock::now();
  HttpClient client(port);
  client.send(first);
  Fate fate;
  if (pause_seconds > 0) {
    for (size_t i = 0; !client.readable(pause_seconds) && i < 1000; ++i) {
      if (!client.send(filler.substr(i % filler.size(), 1))) break;
    }
  } else {
    client.readable(kPatienceSeconds);
  }
  fate.seconds = seconds_since(start);
  if (auto response = client.receive()) fate.response = *response;
  fate.is_closed = client.receive_to_end().has_value();
  return fate;
}

class SlowClients : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    suite_ = std::make_unique<Suite>();
    const auto handler = [](Request& request) -> Reply {
      if (request.head.path == "/large") return Response::text(200, std::string(kLargeBytes, 'x'));
      return TextBody{
          1 << 20, [](Request&, std::string text) { return Response::text(200, std::move(text)); }};
    };
    HttpServerConfig config;
    config.listen = "127.0.0.1:0";
    config.threads = 8;
    config.send.stall_seconds = kShortStallSeconds;
    auto server = start_http_server(config, handler, [](const ExchangeRecord& record) {
      if (record.head->path == "/large") suite_->large_sent.set_value(record.ms / 1000);
    });
    ASSERT_TRUE(server) << server.error().message();
    suite_->server = *std::move(server);
    const int port = suite_->server->port();
    const auto launch = [port](const std::string& first, const std::string& filler, double pause) {
      return std::async(std::launch::async, suffer, port, first, filler, pause).share();
    };
    const std::string post = "POST / HTTP/1.1\r\nHost: h\r\n";
    suite_->still_head = launch("GET / HTTP/1.1\r\nHost:", "", 0);
    suite_->slow_head = launch("GET / HTTP/1.1\r\nHost: h\r\n", "X: a\r\n", 0.25);
    suite_->still_body = launch(post + "Content-Length: 5\r\n\r\nab", "", 0);
    suite_->slow_body = launch(post + "Content-Length: 500\r\n\r\n", "x", 0.25);
    suite_->slow_chunks = launch(post + "Transfer-Encoding: chunked\r\n\r\n", "1\r\nx\r\n", 0.25);
    suite_->reader = std::make_unique<HttpClient>(port);
    suite_->reader->send_get("/large");
  }
  static void TearDownTestSuite() { suite_.reset(); }

  static void expect_deadline_exceeded(const Fate& fate) {
    EXPECT_GE(fate.seconds, kBodyGraceSeconds - 1);
    EXPECT_EQ(fate.response.status, 504);
    EXPECT_EQ(fate.response.code(), "deadline-exceeded");
    EXPECT_EQ(fate.response.detail(), "the body arrives too slowly");
    EXPECT_EQ(fate.response.header("connection"), "close");
  }
  static void expect_closed(const Fate& fate) {
    EXPECT_GE(fate.seconds, kHeadSecondsMax - 1);
    EXPECT_EQ(fate.response.status, 0);
    EXPECT_TRUE(fate.is_closed);
  }

  struct Suite {
    std::unique_ptr<HttpServer> server;
    std::shared_future<Fate> still_head, slow_head, still_body, slow_body, slow_chunks;
    std::unique_ptr<HttpClient> reader;
    std::promise<double> large_sent;
  };
  static std::unique_ptr<Suite> suite_;
};
std::unique_ptr<SlowClients::Suite> SlowClients::suite_;

TEST_F(SlowClients, a_head_that_stands_still_closes_the_connection) {
  expect_closed(suite_->still_head.get());
}

TEST_F(SlowClients, a_head_that_comes_byte_by_byte_closes_the_connection) {
  expect_closed(suite_->slow_head.get());
}

TEST_F(SlowClients, a_body_that_stands_still_exceeds_the_deadline) {
  expect_deadline_exceeded(suite_->still_body.get());
}

TEST_F(SlowClients, a_body_that_comes_byte_by_byte_exceeds_the_deadline) {
  expect_deadline_exceeded(suite_->slow_body.get());
}

TEST_F(SlowClients, a_chunked_body_that_comes_byte_by_byte_exceeds_the_deadline) {
  expect_deadline_exceeded(suite_->slow_chunks.get());
}

TEST_F(SlowClients, a_response_that_is_not_read_is_cut) {
  auto sent = suite_->large_sent.get_future();
  ASSERT_EQ(sent.wait_for(std::chrono::seconds(2 * kPatienceSeconds)), std::future_status::ready);
  EXPECT_GE(sent.get(), kShortStallSeconds);
  const auto rest = suite_->reader->receive_to_end();
  ASSERT_TRUE(rest);
  EXPECT_LT(static_cast<int64_t>(rest->size()), kLargeBytes);
}

TEST(SlowReader, a_reader_below_the_minimum_rate_is_cut_though_it_never_stops) {
  std::promise<int64_t> sent;
  HttpServerConfig config;
  config.listen = "127.0.0.1:0";
  config.send.grace_seconds = 1;
  config.send.rate_min = kLargeBytes;  // what the buffers of both sockets took does not suffice
  auto server = start_http_server(
      config, [](Request&) { return Response::text(200, std::string(kLargeBytes, 'x')); },
      [&](const ExchangeRecord& record) { sent.set_value(record.bytes_out); });
  ASSERT_TRUE(server) << server.error().message();
  HttpClient client((*server)->port());
  const auto start = Clock::now();
  ASSERT_TRUE(client.send_get("/large"));
  // As much as its socket holds at a time, with a pause: never still for as long as a stall is.
  while (!client.receive_some().empty()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_GE(seconds_since(start), config.send.grace_seconds);
  EXPECT_LT(sent.get_future().get(), kLargeBytes);
}

// Downloads of files, by clients that read nothing. All limits but those of pressed downloads are
// longer than the test.
class PressedDownloads : public ::testing::Test {
 protected:
  void start(double pressed_stall_seconds = 0.1) {
    config_.listen = "127.0.0.1:0";
    config_.send.stall_seconds = config_.send.grace_seconds = 3600;
    config_.send.pressed_stall_seconds = pressed_stall_seconds;
    config_.held_files = &held_files_;
    for (const char* name : {"a", "b"}) {
      ASSERT_TRUE(write_file(dir_.path() / name, std::vector<uint8_t>(kLargeBytes, 7)));
    }
    auto server = start_http_server(
        config_,
        [this](Request& request) {
          Response response;
          response.body = FileBody{dir_.path() / request.head.path.substr(1), 0, kLargeBytes};
          return response;
        },
        [this](const ExchangeRecord& record) {
          if (record.bytes_out < kLargeBytes && !was_cut_.exchange(true)) {
            cut_.set_value(record.head->path);
          }
        });
    ASSERT_TRUE(server) << server.error().message();
    server_ = *std::move(server);
  }
  std::unique_ptr<HttpClient> download(const std::string& path) {
    auto client = std::make_unique<HttpClient>(server_->port());
    EXPECT_TRUE(client->send_get(path));
    EXPECT_TRUE(client->receive_head());
    return client;
  }
  // The path of the first download that is cut.
  std::string wait_cut() {
    auto cut = cut_.get_future();
    const bool is_cut = cut.wait_for(std::chrono::seconds(60)) == std::future_status::ready;
    return is_cut ? cut.get() : "none";
  }

  const testing::TemporaryDir dir_;
  HeldFiles held_files_;
  HttpServerConfig config_;
  std::atomic<bool> was_cut_{false};
  std::promise<std::string> cut_;
  std::unique_ptr<HttpServer> server_;
};

TEST_F(PressedDownloads, a_deleted_file_counts_until_its_reader_is_cut_and_others_go_on) {
  start();
  const auto kept = download("/a"), deleted = download("/b");
  EXPECT_EQ(held_files_.bytes(""), 0);
  std::filesystem::remove(dir_.path() / "b");
  EXPECT_EQ(wait_cut(), "/b");
  EXPECT_TRUE(testing::comes_true([&] { return held_files_.bytes("") == 0; }));
  int64_t received = 0;
  for (std::string some = "x"; received < kLargeBytes && !some.empty();) {
    some = kept->receive_some();
    received += std::ssize(some);
  }
  EXPECT_EQ(received, kLargeBytes) << "its file is there";
}

TEST_F(PressedDownloads, a_deleted_file_counts_while_it_is_read) {
  start(3600);
  const auto reader = download("/a");
  std::filesystem::remove(dir_.path() / "a");
  EXPECT_GE(held_files_.bytes(""), kLargeBytes);
  EXPECT_EQ(held_files_.bytes("other"), 0);
}

TEST_F(PressedDownloads, while_the_disk_is_short_a_download_that_stands_still_is_cut) {
  config_.is_disk_short = [] { return true; };
  start();
  const auto reader = download("/a");
  EXPECT_EQ(wait_cut(), "/a");
}

TEST_F(SlowClients, others_are_served_at_once_after_all) {
  HttpClient client(suite_->server->port());
  ASSERT_TRUE(client.send("POST / HTTP/1.1\r\nHost: h\r\nContent-Length: 2\r\n\r\nok"));
  EXPECT_EQ(client.receive().value_or(HttpResponse{}).body, "ok");
}

}  // namespace
}  // namespace voxeld::http
