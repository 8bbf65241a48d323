// Bodies: by length and in chunks, their limits, and what breaks them.
#include "server/http/message/body_decoder.h"

#include <gtest/gtest.h>

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/http/message/head_parser.h"

namespace voxeld::http {
namespace {

// The outcome of decoding some bytes.
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

TEST(ChunkDecoder, refuses_invalid_sizes) {
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

// The outcome of a body that arrived in pieces.
struct Received {
  std::string body, rest;
  std::optional<Error> error;
  bool is_whole = false;
  int64_t bytes_read = 0;
};

Head head_of(const std::string& lines) {
  return parse_head("POST / HTTP/1.1\r\nHost: h\r\n" + lines + "\r\n").value();
}

Received receive(const std::string& lines, const std::vector<std::string>& pieces,
                 int64_t bytes_max = 1000) {
  const Head head = head_of(lines);
  Received received;
  auto decoder = BodyDecoder::open(head, bytes_max);
  if (!decoder) {
    received.error = decoder.error();
    return received;
  }
  for (const std::string& piece : pieces) {
    received.rest += piece;
    const auto whole = decoder->feed(received.rest, [&](std::span<const uint8_t> bytes) -> Status {
      received.body.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
      return {};
    });
    received.bytes_read = decoder->bytes_read();
    if (!whole) {
      received.error = whole.error();
      break;
    }
    received.is_whole = *whole;
  }
  return received;
}

void expect_error(const Received& received, ErrorCode code, const std::string& message) {
  ASSERT_TRUE(received.error);
  EXPECT_EQ(received.error->code, code);
  EXPECT_EQ(received.error->message(), message);
}

TEST(BodyDecoder, a_body_of_known_length_leaves_the_bytes_after_it) {
  const Received received = receive("Content-Length: 5\r\n", {"he", "lloGET /"});
  EXPECT_TRUE(received.is_whole);
  EXPECT_EQ(received.body, "hello");
  EXPECT_EQ(received.rest, "GET /");
  EXPECT_EQ(received.bytes_read, 5);
}

TEST(BodyDecoder, a_chunked_body_leaves_the_bytes_after_it) {
  const Received received = receive("Transfer-Encoding: chunked\r\n",
                                    {kChunks.substr(0, 9), kChunks.substr(9) + "GET /"});
  EXPECT_TRUE(received.is_whole);
  EXPECT_EQ(received.body, kBody);
  EXPECT_EQ(received.rest, "GET /");
  EXPECT_EQ(received.bytes_read, static_cast<int64_t>(kBody.size()));
}

TEST(BodyDecoder, an_empty_body_is_whole_at_once) {
  EXPECT_TRUE(receive("Content-Length: 0\r\n", {""}).is_whole);
  EXPECT_FALSE(receive("Content-Length: 1\r\n", {""}).is_whole);
}

TEST(BodyDecoder, a_body_of_unknown_length_is_length_required) {
  expect_error(receive("", {}), ErrorCode::kLengthRequired,
               "the request has no body length: expected Content-Length, or Transfer-Encoding: "
               "chunked, got neither");
}

TEST(BodyDecoder, a_length_over_the_limit_is_refused_before_anything_is_read) {
  expect_error(receive("Content-Length: 11\r\n", {}, 10), ErrorCode::kPayloadTooLarge,
               "the body is too large: expected at most 10 bytes, got 11");
}

TEST(BodyDecoder, a_body_at_the_limit_is_taken) {
  EXPECT_TRUE(receive("Content-Length: 10\r\n", {"0123456789"}, 10).is_whole);
  EXPECT_TRUE(
      receive("Transfer-Encoding: chunked\r\n", {"5\r\n01234\r\n5\r\n56789\r\n0\r\n\r\n"}, 10)
          .is_whole);
}

TEST(BodyDecoder, chunks_over_the_limit_are_refused_as_soon_as_they_pass_it) {
  const Received received =
      receive("Transfer-Encoding: chunked\r\n", {"5\r\n01234\r\n6\r\n567890\r\n"}, 10);
  expect_error(received, ErrorCode::kPayloadTooLarge,
               "the body is too large: expected at most 10 bytes, got more");
  EXPECT_EQ(received.bytes_read, 11);
}

TEST(BodyDecoder, broken_chunks_are_a_bad_request) {
  expect_error(receive("Transfer-Encoding: chunked\r\n", {"5\r\nhello\r\nxyz\r\n"}),
               ErrorCode::kBadRequest, "chunked body: a chunk's size is not hexadecimal");
}

TEST(BodyDecoder, the_error_of_the_sink_ends_the_body) {
  const Head head = head_of("Content-Length: 5\r\n");
  auto decoder = BodyDecoder::open(head, 10).value();
  std::string buffer = "hello";
  const auto whole = decoder.feed(buffer, [](std::span<const uint8_t>) -> Status {
    return Error{ErrorCode::kStorageFull, "no space", "", ""};
  });
  ASSERT_FALSE(whole);
  EXPECT_EQ(whole.error().code, ErrorCode::kStorageFull);
}

}  // namespace
}  // namespace voxeld::http
