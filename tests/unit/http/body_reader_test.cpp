// Bodies: by length and in chunks, their limits, and what breaks them.
#include "server/http/body_reader.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <string>
#include <thread>
#include <vector>

#include "server/http/head_parser.h"

namespace voxeld::http {
namespace {

// What a decoder made of some bytes.
struct Decoded {
  std::string body, rest;
  std::string error;  // empty: none
  bool done = false;
  friend bool operator==(const Decoded&, const Decoded&) = default;
};

// Feeds the pieces one after the other, as reads from a socket would.
Decoded decode(const std::vector<std::string>& pieces) {
  ChunkDecoder decoder;
  Decoded out;
  for (const std::string& piece : pieces) {
    out.rest += piece;
    if (out.done) continue;
    const auto done = decoder.feed(out.rest, [&](std::string_view text) -> Status {
      out.body += text;
      return {};
    });
    if (!done) {
      out.error = done.error().message();
      EXPECT_EQ(done.error().code, ErrorCode::kBadRequest);
      out.rest.clear();  // unspecified after an error
      return out;
    }
    out.done = *done;
  }
  return out;
}

// The third chunk has a line end in its data.
const std::string kChunks =
    "5\r\nhello\r\n"
    "1;name=value;other=\"quoted\"\r\n \r\n"
    "00c\r\nworld\r\nagain\r\n"
    "0\r\n"
    "Trailer: x\r\nOther: y\r\n\r\n";
const std::string kBody = "hello world\r\nagain";

TEST(ChunkDecoder, joins_chunks_and_drops_extensions_and_trailers) {
  const Decoded out = decode({kChunks + "GET / "});
  EXPECT_EQ(out.error, "");
  EXPECT_TRUE(out.done);
  EXPECT_EQ(out.body, kBody);
  EXPECT_EQ(out.rest, "GET / ");
}

TEST(ChunkDecoder, gives_the_same_at_every_split_and_byte_by_byte) {
  const std::string text = kChunks + "next";
  const Decoded whole = decode({text});
  for (size_t at = 0; at <= text.size(); ++at) {
    EXPECT_EQ(decode({text.substr(0, at), text.substr(at)}), whole) << "split at " << at;
  }
  std::vector<std::string> bytes;
  for (const char c : text) bytes.emplace_back(1, c);
  EXPECT_EQ(decode(bytes), whole);
}

TEST(ChunkDecoder, needs_more_after_every_truncation) {
  for (size_t bytes = 0; bytes < kChunks.size(); ++bytes) {
    const Decoded out = decode({kChunks.substr(0, bytes)});
    EXPECT_EQ(out.error, "") << bytes;
    EXPECT_FALSE(out.done) << bytes;
    EXPECT_EQ(kBody.find(out.body), 0u) << bytes;
  }
}

TEST(ChunkDecoder, takes_an_empty_body_and_sizes_in_both_cases) {
  EXPECT_TRUE(decode({"0\r\n\r\n"}).done);
  EXPECT_TRUE(decode({"000000000000000\r\n\r\n"}).done);
  EXPECT_EQ(decode({"a\r\n0123456789\r\nA\r\n0123456789\r\n0\r\n\r\n"}).body.size(), 20u);
}

TEST(ChunkDecoder, refuses_what_is_no_size) {
  const char* message = "chunked body: a chunk's size is not hexadecimal";
  for (const char* line : {"", ";a", "g", "0x5", "+5", "-5", " 5", "5 ", "5 ;a", "5,5", "0.5",
                           "fffffffffffffffff", "0000000000000005", "1000000000000000"}) {
    EXPECT_EQ(decode({std::string(line) + "\r\nhello\r\n"}).error, message) << '"' << line << '"';
  }
}

TEST(ChunkDecoder, waits_for_the_data_of_the_largest_size_without_overflow) {
  const Decoded out = decode({"fffffffffffffff\r\nabc"});
  EXPECT_EQ(out.error, "");
  EXPECT_EQ(out.body, "abc");
  EXPECT_FALSE(out.done);
}

TEST(ChunkDecoder, refuses_chunks_that_are_longer_or_shorter_than_they_say) {
  const char* longer = "chunked body: a chunk is longer than it says";
  EXPECT_EQ(decode({"4\r\nhello\r\n0\r\n\r\n"}).error, longer);
  EXPECT_EQ(decode({"5\r\nhello\n0\r\n\r\n"}).error, longer);
  EXPECT_EQ(decode({"5\r\nhello5\r\n"}).error, longer);
  EXPECT_EQ(decode({"6\r\nhello\r\n0\r\n\r\n"}).error, longer);
}

TEST(ChunkDecoder, refuses_control_characters_in_sizes_extensions_and_trailers) {
  const char* message = "chunked body: control character";
  for (const std::string text :
       {"5\nhello\r\n", "5;a\nb\r\nhello\r\n", "5;a\rb\r\nhello\r\n", "5;\x7f\r\n",
        "0\r\nA: b\n\nGET / HTTP/1.1\r\n\r\n", "0\r\nA: \x01\r\n\r\n", "0\n\r\n\r\n"}) {
    EXPECT_EQ(decode({text}).error, message) << text;
  }
  EXPECT_EQ(decode({std::string("5;\0\r\n", 5)}).error, message);
  EXPECT_TRUE(decode({"0;\ta\r\nB:\tc\r\n\r\n"}).done);
}

// Whole, and with the line's end missing or arriving late.
void expect_limit(const std::string& before, size_t bytes_max, const std::string& after,
                  const std::string& message) {
  const std::string at_limit = before + std::string(bytes_max - before.size(), 'a');
  for (const std::string& head : {at_limit, at_limit + "\r"}) {
    EXPECT_EQ(decode({"0", head.substr(1)}).error, "");
  }
  EXPECT_TRUE(decode({at_limit + after}).done);
  EXPECT_TRUE(decode({at_limit, after}).done);
  EXPECT_TRUE(decode({at_limit + after.substr(0, 1), after.substr(1)}).done);
  EXPECT_EQ(decode({at_limit + "a" + after}).error, message);
  EXPECT_EQ(decode({at_limit + "a"}).error, message);
  EXPECT_EQ(decode({at_limit, "a"}).error, message);
}

TEST(ChunkDecoder, takes_lines_of_256_bytes_and_no_longer_ones_however_they_arrive) {
  expect_limit("0;", 256, "\r\n\r\n", "chunked body: a line is too long");
}

TEST(ChunkDecoder, takes_trailers_of_8192_bytes_and_no_longer_ones_however_they_arrive) {
  expect_limit("0\r\nA:", 8192 + 3, "\r\n\r\n", "chunked body: trailers are too long");
  std::string many = "0\r\n";
  for (int i = 0; i < 1639; ++i) many += "A: bc\r\n";  // 5 bytes each: 8195
  EXPECT_EQ(decode({many}).error, "chunked body: trailers are too long");
}

TEST(ChunkDecoder, hands_on_the_error_of_the_sink) {
  ChunkDecoder decoder;
  std::string buffer = "5\r\nhello\r\n";
  const auto done = decoder.feed(buffer, [](std::string_view) -> Status {
    return Error{ErrorCode::kStorageFull, "no space", "", ""};
  });
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::kStorageFull);
}

// A connection whose client the test plays.
class BodyReaderTest : public ::testing::Test {
 protected:
  BodyReaderTest() {
    std::array<int, 2> fds{};
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, fds.data()), 0);
    EXPECT_EQ(::fcntl(fds[0], F_SETFL, O_NONBLOCK), 0);
    connection_ = std::make_unique<Connection>(UniqueFd(fds[0]), "test");
    client_ = UniqueFd(fds[1]);
  }
  void send(const std::string& text) {
    ASSERT_EQ(::send(client_.get(), text.data(), text.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(text.size()));
  }
  // What was sent to the client and not yet looked at.
  std::string sent_to_client() {
    std::array<char, 4096> bytes;
    const ssize_t got = ::recv(client_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    return got > 0 ? std::string(bytes.data(), static_cast<size_t>(got)) : "";
  }
  void set_head(const std::string& lines, const std::string& version = "1.1") {
    auto head = parse_head("POST / HTTP/" + version + "\r\nHost: h\r\n" + lines + "\r\n");
    ASSERT_TRUE(head) << head.error().message();
    head_ = *std::move(head);
  }
  // Reads with a reader of its own; sets reader facts for the test to look at.
  Result<std::string> read(int64_t bytes_max = 1000) {
    BodyReader reader(*connection_, head_);
    auto text = reader.read_text(bytes_max);
    finished_ = reader.finished();
    bytes_read_ = reader.bytes_read();
    return text;
  }
  void expect_error(const Result<std::string>& text, ErrorCode code, const std::string& message) {
    ASSERT_FALSE(text);
    EXPECT_EQ(text.error().code, code);
    EXPECT_EQ(text.error().message(), message);
    EXPECT_FALSE(finished_) << "the connection must close";
  }

  std::unique_ptr<Connection> connection_;
  UniqueFd client_;
  Head head_;
  bool finished_ = false;
  int64_t bytes_read_ = 0;
};

TEST_F(BodyReaderTest, a_body_of_known_length_leaves_what_follows_it) {
  set_head("Content-Length: 5\r\n");
  send("helloGET /");
  EXPECT_EQ(read().value(), "hello");
  EXPECT_TRUE(finished_);
  EXPECT_EQ(bytes_read_, 5);
  EXPECT_EQ(connection_->buffer(), "GET /");
}

TEST_F(BodyReaderTest, a_chunked_body_leaves_what_follows_it) {
  set_head("Transfer-Encoding: chunked\r\n");
  connection_->buffer() = kChunks.substr(0, 9);  // came with the head
  send(kChunks.substr(9) + "GET /");
  EXPECT_EQ(read().value(), kBody);
  EXPECT_TRUE(finished_);
  EXPECT_EQ(bytes_read_, static_cast<int64_t>(kBody.size()));
  EXPECT_EQ(connection_->buffer(), "GET /");
}

TEST_F(BodyReaderTest, a_body_larger_than_every_buffer_arrives_whole) {
  std::string body;
  for (int i = 0; i < 500'000; ++i) body += static_cast<char>('a' + i % 23);
  set_head("Content-Length: 500000\r\n");
  std::thread client([&] {
    for (size_t at = 0; at < body.size(); at += 50'000) send(body.substr(at, 50'000));
  });
  const auto text = read(500'000);
  client.join();
  ASSERT_TRUE(text) << text.error().message();
  EXPECT_TRUE(*text == body);
}

TEST_F(BodyReaderTest, a_request_without_body_is_finished_before_it_is_read) {
  set_head("");
  EXPECT_TRUE(BodyReader(*connection_, head_).finished());
  set_head("Content-Length: 0\r\n");
  EXPECT_TRUE(BodyReader(*connection_, head_).finished());
  EXPECT_EQ(read().value(), "");
  EXPECT_TRUE(finished_);
}

TEST_F(BodyReaderTest, a_body_of_unknown_length_is_length_required) {
  set_head("");
  const auto text = read();
  ASSERT_FALSE(text);
  EXPECT_EQ(text.error().code, ErrorCode::kLengthRequired);
  EXPECT_EQ(text.error().message(),
            "the request has no body length: expected Content-Length, or Transfer-Encoding: "
            "chunked, got neither");
}

TEST_F(BodyReaderTest, a_length_over_the_limit_is_refused_before_anything_is_read) {
  set_head("Content-Length: 11\r\n");
  expect_error(read(10), ErrorCode::kPayloadTooLarge,
               "the body is too large: expected at most 10 bytes, got 11");
  EXPECT_EQ(bytes_read_, 0);
}

TEST_F(BodyReaderTest, a_body_at_the_limit_is_taken) {
  set_head("Content-Length: 10\r\n");
  send("0123456789");
  EXPECT_EQ(read(10).value(), "0123456789");
  set_head("Transfer-Encoding: chunked\r\n");
  send("5\r\n01234\r\n5\r\n56789\r\n0\r\n\r\n");
  EXPECT_EQ(read(10).value(), "0123456789");
}

TEST_F(BodyReaderTest, chunks_over_the_limit_are_refused_as_soon_as_they_pass_it) {
  set_head("Transfer-Encoding: chunked\r\n");
  send("5\r\n01234\r\n6\r\n567890\r\n");  // no end
  expect_error(read(10), ErrorCode::kPayloadTooLarge,
               "the body is too large: expected at most 10 bytes, got more");
  EXPECT_EQ(bytes_read_, 11);
}

TEST_F(BodyReaderTest, broken_chunks_are_a_bad_request) {
  set_head("Transfer-Encoding: chunked\r\n");
  send("5\r\nhello\r\nxyz\r\n");
  expect_error(read(), ErrorCode::kBadRequest, "chunked body: a chunk's size is not hexadecimal");
}

TEST_F(BodyReaderTest, bodies_that_end_early_are_a_bad_request) {
  set_head("Content-Length: 6\r\n");
  send("hello");
  ASSERT_EQ(::shutdown(client_.get(), SHUT_WR), 0);
  expect_error(read(), ErrorCode::kBadRequest, "the body ends early");
  EXPECT_EQ(bytes_read_, 5);
}

TEST_F(BodyReaderTest, chunked_bodies_that_end_early_are_a_bad_request) {
  set_head("Transfer-Encoding: chunked\r\n");
  send("5\r\nhello\r\n0\r\n");
  ASSERT_EQ(::shutdown(client_.get(), SHUT_WR), 0);
  expect_error(read(), ErrorCode::kBadRequest, "the body ends early");
}

TEST_F(BodyReaderTest, a_client_that_expects_it_is_told_to_continue_once) {
  set_head("Content-Length: 5\r\nExpect: 100-continue\r\n");
  std::string told;
  std::thread client([&] {
    std::array<char, 100> bytes;
    const ssize_t got = ::recv(client_.get(), bytes.data(), bytes.size(), 0);
    told.assign(bytes.data(), static_cast<size_t>(std::max<ssize_t>(got, 0)));
    send("he");
    send("llo");
  });
  EXPECT_EQ(read().value(), "hello");
  client.join();
  EXPECT_EQ(told, "HTTP/1.1 100 Continue\r\n\r\n");
  EXPECT_EQ(sent_to_client(), "");
}

TEST_F(BodyReaderTest, a_client_that_sent_its_body_already_is_not_told_to_continue) {
  set_head("Content-Length: 5\r\nExpect: 100-continue\r\n");
  connection_->buffer() = "he";
  send("llo");
  EXPECT_EQ(read().value(), "hello");
  EXPECT_EQ(sent_to_client(), "");
}

TEST_F(BodyReaderTest, a_client_whose_body_is_too_large_is_not_told_to_continue) {
  set_head("Content-Length: 11\r\nExpect: 100-continue\r\n");
  EXPECT_FALSE(read(10));
  EXPECT_EQ(sent_to_client(), "");
}

TEST_F(BodyReaderTest, clients_of_http_1_0_are_not_told_to_continue) {
  set_head("Content-Length: 5\r\nExpect: 100-continue\r\n", "1.0");
  send("hello");
  EXPECT_EQ(read().value(), "hello");
  EXPECT_EQ(sent_to_client(), "");
}

TEST_F(BodyReaderTest, the_error_of_the_sink_ends_the_reading) {
  set_head("Content-Length: 5\r\n");
  send("hello");
  BodyReader reader(*connection_, head_);
  const Status status = reader.read(10, [](std::span<const uint8_t>) -> Status {
    return Error{ErrorCode::kStorageFull, "no space", "", ""};
  });
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kStorageFull);
  EXPECT_FALSE(reader.finished());
}

}  // namespace
}  // namespace voxeld::http
