// Responses that are made in pieces, and the budget of bytes that their clients have not read.
#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "server/http/memory_budget.h"
#include "tests/unit/http/http_server_fixture.h"

namespace voxeld::http {
namespace {

constexpr int kPieces = 300;
constexpr size_t kPieceBytes = 60'000;

class PiecesTest : public HttpServerTest {
 protected:
  // `count` pieces of `bytes` each; the piece `failing` fails.
  void add_pieces(const std::string& path, int count, size_t bytes, int failing = -1) {
    on("GET", path, [this, count, bytes, failing](Request&) {
      Response response = Response::json(200, "");
      response.headers["ETag"] = "\"e\"";
      response.body = PieceBody{[this, count, bytes, failing, i = 0]() mutable -> Result<Piece> {
        if (i == failing) return Error{ErrorCode::kGone, "the rest is gone", "", ""};
        ++made_;
        ++i;
        return Piece{std::string(bytes, static_cast<char>('a' + i % 26)), i == count};
      }};
      return response;
    });
  }
  // The number of pieces made when no more are made, as the sockets' buffers are full. A busy
  // machine makes none for a while, too: others must be served between several equal looks.
  int made_when_blocked() {
    constexpr int kLooks = 4;
    int before = -1, equal = 0;
    EXPECT_TRUE(comes_true([&] {
      EXPECT_EQ(get("/hello").body, "hello");
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      const int now = made_;
      const bool is_blocked = now == before && now > 0 && server_->state().requests_running == 0;
      equal = is_blocked ? equal + 1 : 0;
      before = now;
      return equal == kLooks;
    }));
    EXPECT_GT(server_->state().memory_bytes, 0);
    return made_;
  }
  std::atomic<int> made_{0};
};

TEST_F(PiecesTest, several_are_chunked_and_the_connection_goes_on) {
  add_pieces("/pieces", 3, 10);
  start();
  HttpClient client(port());
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(client.send_get("/pieces"));
    const HttpResponse response = client.receive().value_or(HttpResponse{});
    EXPECT_EQ(response.header("transfer-encoding"), "chunked");
    EXPECT_EQ(response.header("content-length"), "");
    EXPECT_EQ(response.body, "bbbbbbbbbbccccccccccdddddddddd");
  }
}

TEST_F(PiecesTest, a_single_one_has_a_length) {
  add_pieces("/pieces", 1, 10);
  start();
  const HttpResponse response = get("/pieces");
  EXPECT_EQ(response.header("transfer-encoding"), "");
  EXPECT_EQ(response.header("content-length"), "10");
  EXPECT_EQ(response.body, "bbbbbbbbbb");
}

TEST_F(PiecesTest, for_http_1_0_the_end_of_the_connection_is_that_of_the_body) {
  add_pieces("/pieces", 3, 2);
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send("GET /pieces HTTP/1.0\r\nConnection: keep-alive\r\n\r\n"));
  const std::string all = client.receive_to_end().value_or("");
  EXPECT_TRUE(all.ends_with("\r\n\r\nbbccdd")) << all;
  EXPECT_EQ(all.find("Transfer-Encoding"), std::string::npos);
  EXPECT_NE(all.find("Connection: close"), std::string::npos);
}

TEST_F(PiecesTest, a_head_request_gets_the_head_alone) {
  add_pieces("/pieces", 3, 10);
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send("HEAD /pieces HTTP/1.1\r\nHost: h\r\n\r\n"));
  const HttpResponse head = client.receive(/*has_body=*/false).value_or(HttpResponse{});
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.header("etag"), "\"e\"");
  ASSERT_TRUE(client.send_get("/hello"));
  EXPECT_EQ(client.receive().value_or(HttpResponse{}).body, "hello");
}

TEST_F(PiecesTest, an_error_of_the_first_piece_becomes_the_response) {
  add_pieces("/pieces", 3, 10, /*failing=*/0);
  start();
  const HttpResponse response = get("/pieces");
  EXPECT_EQ(response.status, 410);
  EXPECT_EQ(response.header("content-type"), "application/problem+json");
  EXPECT_EQ(response.header("etag"), "");
  EXPECT_NE(response.header("x-request-id"), "");
  EXPECT_EQ(response.detail(), "the rest is gone");
  EXPECT_EQ(observed(1)[0].status, 410);
}

TEST_F(PiecesTest, a_later_error_cuts_the_connection_before_the_end_of_the_body) {
  add_pieces("/pieces", 3, 10, /*failing=*/2);
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send_get("/pieces"));
  const std::string all = client.receive_to_end().value_or("");
  EXPECT_TRUE(all.ends_with("a\r\ncccccccccc\r\n")) << all;
}

TEST_F(PiecesTest, a_client_that_does_not_read_costs_one_piece) {
  add_pieces("/pieces", kPieces, kPieceBytes);
  start();
  HttpClient client(port());
  ASSERT_TRUE(client.send_get("/pieces"));
  const int made = made_when_blocked();
  EXPECT_LT(made, kPieces / 2) << "the buffers of both sockets do not hold more";
  EXPECT_LE(server_->state().memory_bytes, kPieceBytesMax);
  EXPECT_EQ(get("/hello").body, "hello");
  EXPECT_EQ(made_, made);
  EXPECT_EQ(client.receive().value_or(HttpResponse{}).body.size(), kPieces * kPieceBytes);
  EXPECT_TRUE(comes_true([&] { return server_->state().memory_bytes == 0; }));
}

TEST_F(PiecesTest, responses_over_the_budget_wait_without_a_thread_and_continue_when_bytes_leave) {
  add_pieces("/pieces", kPieces, kPieceBytes);
  HttpServerConfig config;
  config.threads = 2;
  config.memory = {2 * kPieceBytesMax, 2 * kPieceBytesMax};
  start_with(config);
  std::vector<HttpClient> clients;
  for (int i = 0; i < 8; ++i) {
    ASSERT_TRUE(clients.emplace_back(port()).send_get("/pieces"));
  }
  ASSERT_TRUE(comes_true([&] { return server_->state().memory_bytes > kPieceBytesMax; }));
  EXPECT_LE(server_->state().memory_bytes, 2 * kPieceBytesMax);
  EXPECT_EQ(get("/hello").body, "hello") << "a small response does not wait";
  // Side by side: which of them have the budget is not known, and the others wait for these.
  std::vector<std::thread> readers;
  for (HttpClient& client : clients) {
    readers.emplace_back([&client] {
      EXPECT_EQ(client.receive().value_or(HttpResponse{}).body.size(), kPieces * kPieceBytes);
    });
  }
  for (std::thread& reader : readers) reader.join();
  EXPECT_TRUE(comes_true([&] { return server_->state().memory_bytes == 0; }));
}

TEST_F(PiecesTest, waiting_responses_continue_when_a_client_leaves) {
  add_pieces("/pieces", kPieces, kPieceBytes);
  HttpServerConfig config;
  config.memory = {kPieceBytesMax, kPieceBytesMax};
  start_with(config);
  HttpClient first(port());
  ASSERT_TRUE(first.send_get("/pieces"));
  made_when_blocked();
  HttpClient second(port());
  ASSERT_TRUE(second.send_get("/pieces"));
  EXPECT_FALSE(second.readable(0.3));
  first.close();
  EXPECT_EQ(second.receive().value_or(HttpResponse{}).body.size(), kPieces * kPieceBytes);
}

TEST(MemoryBudget, one_tenants_bytes_are_not_anothers) {
  MemoryBudget budget({100, 1000});
  MemoryShare first(budget, "lab", nullptr), second(budget, "lab", &budget);
  MemoryShare other(budget, "studio", nullptr);
  EXPECT_TRUE(first.reserve(80));
  EXPECT_FALSE(second.reserve(30));
  EXPECT_TRUE(other.reserve(100));
  EXPECT_TRUE(budget.grant().empty());
  first.set(60);
  EXPECT_EQ(budget.grant(), std::vector<void*>{&budget});
  EXPECT_TRUE(second.reserve(30));
  EXPECT_EQ(budget.bytes(), 190);
}

TEST(MemoryBudget, a_share_that_holds_nothing_gets_its_piece_however_large) {
  MemoryBudget budget({100, 200});
  MemoryShare first(budget, "lab", nullptr), other(budget, "studio", nullptr);
  EXPECT_TRUE(first.reserve(500));
  EXPECT_TRUE(other.reserve(500));
}

TEST(MemoryBudget, waiting_shares_are_served_in_their_order) {
  MemoryBudget budget({100, 100});
  int one = 1, two = 2;
  MemoryShare holder(budget, "lab", nullptr);
  EXPECT_TRUE(holder.reserve(100));
  MemoryShare first(budget, "lab", &one), second(budget, "lab", &two);
  EXPECT_FALSE(first.reserve(100));
  EXPECT_FALSE(second.reserve(1));
  EXPECT_FALSE(holder.reserve(1)) << "others wait already";
  EXPECT_EQ(budget.grant(), std::vector<void*>{&one});
  EXPECT_FALSE(second.reserve(1));
}

}  // namespace
}  // namespace voxeld::http
